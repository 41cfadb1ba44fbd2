use super::*;

fn picture(grey: &[f32]) -> Picture {
    Picture {
        width: grey.len() as u32,
        height: 1,
        linear: grey.iter().map(|&g| [g; 3]).collect(),
    }
}

fn truth(grey: &[f32], standard_error: f32, mask: &[f32]) -> Truth {
    Truth {
        picture: picture(grey),
        standard_error: vec![[standard_error; 3]; grey.len()],
        mask: mask.to_vec(),
    }
}

fn near(a: f64, b: f64) -> bool {
    (a - b).abs() < 1e-7
}

#[test]
fn figures_by_kind_against_hand_computed_ones() {
    let truth = truth(&[0.0, 0.5, 1.0, 0.25], 0.0, &[0.0, 0.3, 1.0, 1.0]);
    let test = picture(&[0.1, 0.5, 1.3, 0.05]);
    let errors = Errors::of(&test, &truth);
    let mse = (0.01 + 0.0 + 0.09 + 0.04) / 4.0;
    assert!(near(errors.all.mse, mse) && near(errors.all.rmse, f64::sqrt(mse)));
    let rel = (0.01 / 0.01 + 0.09 / 1.01 + 0.04 / 0.0725) / 4.0;
    assert!(near(errors.all.rel_mse, rel), "{}", errors.all.rel_mse);
    assert!(near(errors.all.p99, 0.3));
    let [background, edge, virtual_] =
        [errors.background, errors.edge, errors.virtual_].map(|f| f.unwrap());
    assert_eq!(
        [background.pixels, edge.pixels, virtual_.pixels],
        [1, 1, 2],
        "each pixel is of one kind"
    );
    assert!(near(background.rmse, 0.1) && edge.rmse == 0.0);
    assert!(near(virtual_.mse, 0.065));
    assert!(virtual_.flip > 0.0 && errors.reference_share == 0.0);
}

#[test]
fn the_references_own_noise_is_taken_off() {
    let truth = truth(&[0.0, 0.0], 0.06, &[0.0, 0.0]);
    let errors = Errors::of(&picture(&[0.1, 0.1]), &truth);
    assert!(near(errors.all.mse, 0.01 - 0.0036));
    assert!(near(errors.reference_share, 0.36));
    let less = Errors::of(&picture(&[0.01, 0.01]), &truth);
    assert!(less.all.mse < 0.0 && less.all.rmse == 0.0);
    let mean = Errors::mean(&[errors, less]);
    assert!(near(mean.all.mse, (0.0064 - 0.0035) / 2.0));
    assert!(near(mean.all.rmse, mean.all.mse.sqrt()));
    assert!(near(mean.all.p99, 0.055) && mean.edge.is_none());
}

#[test]
fn percentiles_of_a_ramp() {
    let ramp = || -> Vec<f64> { (1..=200).rev().map(f64::from).collect() };
    assert_eq!(percentile(&mut ramp(), 0.99), 198.0);
    assert_eq!(percentile(&mut ramp(), 0.5), 100.0);
    assert_eq!(percentile(&mut ramp(), 1.0), 200.0);
    assert_eq!(percentile(&mut [], 0.99), 0.0);
}
