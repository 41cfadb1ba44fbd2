use super::settings::{NoiseFit, WHITE};
use super::{NoiseInput, NoiseMethod, NoiseProfile, NoiseSettings, NoiseStage};
use crate::stages::test_support::{codes_apart, mask, picture, random, stages};

fn profile() -> NoiseProfile {
    let mut profile = NoiseProfile::from_fit(NoiseFit { a: 0.1, b: 9.0 }, 4);
    for (c, lags) in profile.autocorrelation.iter_mut().enumerate() {
        lags[0][2] = 0.5;
        lags[0][4] = 0.5;
        lags[1][3] = 0.4 - 0.1 * c as f64;
        lags[1][2] = 0.2;
        lags[1][4] = 0.2;
    }
    profile.channel_correlation = [0.5, 0.2, 0.4];
    profile
}

#[test]
fn noise_is_the_same() {
    let Some(gpu) = stages() else { return };
    let photo = picture(2);
    let mask = mask();
    let soft: Vec<f32> = mask
        .iter()
        .enumerate()
        .map(|(i, m)| m * random(i, 9))
        .collect();
    let ratio: Vec<[f32; 3]> = (0..mask.len()).map(|i| [0.5 + random(i, 10); 3]).collect();
    let variance: Vec<[f32; 3]> = (0..mask.len()).map(|i| [1e-5 * random(i, 11); 3]).collect();
    let full = NoiseInput {
        photo: Some(&photo.linear),
        mask: Some(&soft),
        ratio: Some(&ratio),
        variance: Some(&variance),
    };
    let alone = NoiseInput::default();
    let mut white = profile();
    white.autocorrelation = [WHITE; 3];
    for (profile, method, input) in [
        (profile(), NoiseMethod::Missing, full),
        (profile(), NoiseMethod::Missing, alone),
        (white, NoiseMethod::Missing, full),
        (profile(), NoiseMethod::Textures, full),
    ] {
        let settings = NoiseSettings {
            method,
            texture_size: 64,
            magnification: 2.5,
            ..NoiseSettings::new(profile)
        };
        let stage = NoiseStage::new(&settings, 77);
        let mut source = picture(3);
        for (i, value) in source.linear.iter_mut().enumerate() {
            if soft[i] == 0.0 {
                *value = photo.linear[i];
            }
        }
        let (mut on_cpu, mut on_gpu) = (source.clone(), source.clone());
        stage.apply(&mut on_cpu, &input, 5);
        gpu.noise(&stage, &mut on_gpu, &input, 5).expect("runs");
        let apart = codes_apart(&on_cpu.linear, &on_gpu.linear);
        assert!(apart.0 < 1e-3, "{method:?}: {apart:?}");
        assert!(
            codes_apart(&on_cpu.linear, &source.linear).1 > 3,
            "there is noise"
        );
        if input.photo.is_some() && method == NoiseMethod::Missing {
            for i in (0..soft.len()).filter(|i| soft[*i] == 0.0) {
                assert_eq!(
                    on_gpu.linear[i].map(f32::to_bits),
                    photo.linear[i].map(f32::to_bits)
                );
            }
        }
        let mut other = source.clone();
        gpu.noise(&stage, &mut other, &input, 6).expect("runs");
        assert!(
            codes_apart(&on_cpu.linear, &other.linear).0 > 0.1,
            "control: another frame"
        );
    }
}
