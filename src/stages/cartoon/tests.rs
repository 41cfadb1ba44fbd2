use super::{CartoonSettings, CartoonStyle, cartoon};
use crate::stages::EncodedImage;
use crate::stages::test_support::{codes_apart, picture, stages};

#[test]
fn the_cartoon_is_the_same() {
    let Some(gpu) = stages() else { return };
    let image = EncodedImage::from_picture(&picture(1));
    for style in [CartoonStyle::Photometric, CartoonStyle::Flow] {
        let settings = CartoonSettings {
            style,
            shrunk_width: 43,
            shrunk_height: 31,
            s0: 0.02,
            a0: 0.05,
            ..CartoonSettings::default()
        };
        let on_cpu = cartoon(&image, &settings, true);
        let on_gpu = gpu.cartoon(&image, &settings, true).expect("runs");
        let linear = |image: &EncodedImage| image.to_picture().linear;
        let apart = codes_apart(&linear(&on_cpu.image), &linear(&on_gpu.image));
        assert!(apart.1 <= 1, "{style:?}: {apart:?}");
        let (a, b) = (
            on_cpu.edges.expect("asked for"),
            on_gpu.edges.expect("asked for"),
        );
        assert!(
            a.silhouette.iter().any(|s| *s > 0.5),
            "{style:?}: there are lines"
        );
        for (a, b) in [
            (&a.simplified, &b.simplified),
            (&a.original, &b.original),
            (&a.silhouette, &b.silhouette),
        ] {
            let worst = a
                .iter()
                .zip(b)
                .map(|(a, b)| (a - b).abs())
                .fold(0.0, f32::max);
            assert!(worst < 2e-3, "{style:?}: {worst}");
        }
        let other = CartoonSettings {
            iterations: 6,
            ..settings
        };
        let other = gpu.cartoon(&image, &other, false).expect("runs");
        assert!(
            codes_apart(&linear(&on_cpu.image), &linear(&other.image)).1 > 1,
            "control"
        );
    }
}
