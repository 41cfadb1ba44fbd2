//! How the picture of a camera that rests grows from frame to frame.

/// Seconds after which a picture that has all its rays is begun anew, from the newest photograph.
const RENEWED_SECS: f64 = 2.0;

/// Rays per pixel that the first picture is shown with: one tells no rare bright sample from light, and shows each as a speckle.
const FIRST_RAYS: u32 = 2;

/// What a frame does for the picture of the whole size, beside showing what is there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// It is begun from this frame.
    Begin,
    /// It gets rays.
    Refine,
    /// It is shown from now on.
    Show,
    /// Nothing.
    Keep,
}

/// Where the picture of a resting camera stands. Its first one is shown with two rays per pixel, four, eight and so on; those that follow once they have as
/// many as it.
#[derive(Clone, Debug, Default)]
pub struct Resting {
    /// When the picture was begun, seconds.
    begun: Option<f64>,
    /// Rays per pixel that it has when it is shown next.
    due: u32,
    /// It has been shown with all its rays.
    is_whole: bool,
}

impl Resting {
    /// The step of a frame at this time, where the picture has so many of `most` rays per pixel.
    pub fn step(&mut self, secs: f64, rays: u32, most: u32) -> Step {
        match self.begun {
            None => {
                self.begun = Some(secs);
                self.due = FIRST_RAYS;
                Step::Begin
            }
            Some(begun) if self.is_whole && secs - begun < RENEWED_SECS => Step::Keep,
            Some(_) if self.is_whole => {
                self.begun = Some(secs);
                self.is_whole = false;
                Step::Begin
            }
            Some(_) if rays >= self.due.min(most) => {
                self.is_whole = rays >= most;
                self.due = (2 * rays).min(most);
                Step::Show
            }
            Some(_) => Step::Refine,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The steps of frames of 0.1 s, where each that refines brings half a ray per pixel.
    fn steps(most: u32, frames: u32) -> Vec<(Step, u32)> {
        let (mut resting, mut halves) = (Resting::default(), 0);
        (0..frames)
            .map(|frame| {
                let step = resting.step(0.1 * f64::from(frame), halves / 2, most);
                match step {
                    Step::Begin => halves = 0,
                    Step::Refine => halves += 1,
                    Step::Show | Step::Keep => {}
                }
                (step, halves / 2)
            })
            .collect()
    }

    fn shown(steps: &[(Step, u32)]) -> Vec<u32> {
        let shown = steps.iter().filter(|(step, _)| *step == Step::Show);
        shown.map(|(_, rays)| *rays).collect()
    }

    #[test]
    fn the_first_picture_is_shown_as_it_doubles_and_the_next_with_all_its_rays() {
        let steps = steps(6, 45);
        assert_eq!(steps[0].0, Step::Begin);
        assert_eq!(shown(&steps), [2, 4, 6, 6]);
        let begun = steps.iter().filter(|(step, _)| *step == Step::Begin);
        assert_eq!(begun.count(), 3);
    }

    #[test]
    fn a_picture_with_all_its_rays_is_kept_for_two_seconds() {
        let steps = steps(1, 45);
        let begun: Vec<usize> = (0..45).filter(|at| steps[*at].0 == Step::Begin).collect();
        assert_eq!(begun, [0, 20, 40]);
        assert_eq!(shown(&steps), [1, 1, 1]);
        assert!(steps[5..20].iter().all(|(step, _)| *step == Step::Keep));
    }
}
