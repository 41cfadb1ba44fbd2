//! What a script expects of the window.

use glam::DVec3;

use super::{NO_FRAMES, Window};
use crate::preview::quantity::decimal;
use crate::preview::script::Expectation;

impl Window {
    pub(super) fn expect(&mut self, expectation: &Expectation) -> Result<(), String> {
        let session = self.session();
        let composition = session.composition().ok_or("no scene is read")?;
        let holds = match expectation {
            Expectation::Value(quantity, value, share) => {
                let is = quantity.of(composition);
                let close = |is: f64| (is - value).abs() <= share * value.abs();
                if !is.is_some_and(close) {
                    let is = is.map_or("nothing".to_owned(), |is| is.to_string());
                    return Err(format!(
                        "it is {is}; expected {value}; see the steps before"
                    ));
                }
                true
            }
            Expectation::Material(name, number, value) => {
                let form = composition.materials[self.object(name)?];
                let is = form.map(|form| decimal(number.of(&form)));
                if !is.is_some_and(|is| (is - value).abs() <= 1e-5) {
                    let is = is.map_or("the mesh's own".to_owned(), |is| is.to_string());
                    return Err(format!(
                        "it is {is}; expected {value}; see the steps before"
                    ));
                }
                true
            }
            Expectation::Position(name, point, within) => {
                let is = composition.placement(self.object(name)?).translation;
                if !((is - DVec3::from(*point)).length() <= *within) {
                    return Err(format!(
                        "`{name}` is at {is}; expected {point:?} within {within} m; see the steps before"
                    ));
                }
                true
            }
            Expectation::Keys(name, times) => {
                let are = composition.key_times_secs(self.track(name)?);
                let is_same = are.len() == times.len()
                    && (are.iter().zip(times)).all(|(is, wanted)| (is - wanted).abs() < 1e-4);
                if !is_same {
                    return Err(format!(
                        "`{name}` has keys at {are:?}; expected {times:?}; see the steps before"
                    ));
                }
                true
            }
            Expectation::Rests(name, within) => {
                let object = self.object(name)?;
                let gap = session
                    .loaded()
                    .and_then(|l| l.geometry.gap_m(composition, object));
                let gap = gap.ok_or("there is no real surface under it")?;
                if !(gap.abs() <= *within) {
                    return Err(format!(
                        "`{name}` is {gap} m above the surface; expected at most {within}; see the steps before"
                    ));
                }
                true
            }
            Expectation::Frame(number) => {
                let frames = session.frames().ok_or(NO_FRAMES)?;
                frames.posed()[session.frame()].number == *number
            }
            Expectation::Saved => !session.is_dirty(),
            Expectation::Unsaved => session.is_dirty(),
            Expectation::Problem => session.problem().is_some(),
            Expectation::NoProblem => session.problem().is_none(),
            Expectation::FileEqualsWindow => self.file_equals_window()?,
            Expectation::FileDiffersFromWindow => !self.file_equals_window()?,
        };
        match holds {
            true => Ok(()),
            false => Err(format!(
                "{expectation:?} does not hold; see the steps before"
            )),
        }
    }
}
