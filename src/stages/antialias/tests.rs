use super::{AntialiasSettings, antialias};
use crate::stages::test_support::{codes_apart, mask, picture, stages};

#[test]
fn antialiasing_is_the_same() {
    let Some(gpu) = stages() else { return };
    let (source, mask) = (picture(4), mask());
    let settings = AntialiasSettings { beta: 0.8 };
    let (mut on_cpu, mut on_gpu) = (source.clone(), source.clone());
    assert!(antialias(&mut on_cpu, &mask, &settings));
    assert!(gpu.antialias(&mut on_gpu, &mask, &settings).expect("runs"));
    assert!(codes_apart(&on_cpu.linear, &on_gpu.linear).1 <= 1);
    assert!(codes_apart(&on_cpu.linear, &source.linear).1 > 1, "control");
    let mut soft = mask;
    soft[0] = 0.5;
    assert!(!gpu.antialias(&mut on_gpu, &soft, &settings).expect("runs"));
}
