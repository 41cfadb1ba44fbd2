use super::*;

#[test]
fn each_switch_takes_back_its_own() {
    let pixel = PixelInfo {
        difference_period: 8,
        sample_factor: 2,
        flags: PIXEL_OUT_OF_REACH,
    };
    let after = |skips: &[Skip]| {
        let mut pixels = [pixel];
        skips
            .iter()
            .copied()
            .collect::<Without>()
            .apply_to_pixels(&mut pixels);
        pixels[0]
    };
    assert_eq!(after(&[]), pixel);
    assert_eq!(after(&[Skip::EdgeReal, Skip::Cones]), pixel);
    assert_eq!(after(&[Skip::Plan]), PixelInfo::uniform(pixel.flags));
    assert_eq!(after(&[Skip::OutOfReach]).flags, 0);
    assert_eq!(after(&[Skip::Beams]), pixel, "no ray, no beam");
    let both = after(&[Skip::Beams, Skip::OutOfReach]);
    assert_eq!(both.flags, PIXEL_BEAM_MAY_MEET_VIRTUAL);
    for (name, skip) in Skip::CHOICES {
        let without: Without = [*skip].into_iter().collect();
        let on = Skip::CHOICES.iter().filter(|(_, s)| without.contains(*s));
        assert_eq!(on.count(), 1, "{name}");
        assert_eq!(without.names(), *name);
    }
    for without in [&[][..], &[Skip::CameraNoise, Skip::Plan]] {
        let without: Without = without.iter().copied().collect();
        assert_eq!(Without::from_names(&without.names()), Some(without));
    }
    assert_eq!(Without::from_names("plan,cone"), None);
}

#[test]
fn only_what_may_show_is_kept_with_films_and_pictures() {
    let all: Without = Skip::CHOICES.iter().map(|&(_, skip)| skip).collect();
    let of_pictures = "plan,beams,cones,sharing,last-vertex,photons,guide";
    assert_eq!(all.of_pictures(false).names(), of_pictures);
    let of_films = "out-of-reach,plan,beams,edge-real,cones,sharing,last-vertex,photons,guide";
    assert_eq!(all.of_films(false).names(), of_films);
    let on_gpu = format!("{of_films},specialisation");
    assert_eq!(all.of_films(true).names(), on_gpu);
    assert_eq!(Without::default().of_films(true), Without::default());
}

#[test]
fn what_does_nothing_is_told() {
    let all: Without = Skip::CHOICES.iter().map(|&(_, skip)| skip).collect();
    let names = |estimator, on_gpu, goal: Option<&ErrorGoal>| {
        let idle = all.idle(estimator, on_gpu, goal);
        idle.iter().map(|(name, _)| *name).collect::<Vec<_>>()
    };
    let goal = ErrorGoal {
        standard_error: Some(0.01),
        noise: None,
        max_rays_per_pixel: 64,
    };
    let goals = ["adaptive", "camera-noise"];
    assert_eq!(names(Estimator::Direct, true, None), goals);
    assert_eq!(
        names(Estimator::Direct, false, Some(&goal)),
        ["specialisation", "camera-noise"]
    );
    let noise = ErrorGoal {
        noise: Some(super::super::CameraNoise {
            fit: [crate::scene::NoiseFit { a: 0.02, b: 0.5 }; 3],
        }),
        ..goal
    };
    assert!(names(Estimator::Direct, true, Some(&noise)).is_empty());
    let left = all.0.count_ones() as usize - names(Estimator::Paper, true, Some(&noise)).len();
    assert_eq!(left, 4, "out-of-reach, specialisation and the goals'");
}
