use super::*;
use crate::film::Film;
use crate::renderer::{Budget, Renderer, RendererOptions, Watcher};
use crate::scene::Choice;

#[test]
fn triangles_come_out_as_asked() {
    for (step, count) in steps(Law::Triangles, 8).iter().zip(triangle_counts()) {
        let ratio = step.work as f64 / f64::from(count);
        assert!((ratio - 1.0).abs() < 0.08, "{} for {count}", step.work);
    }
    assert_eq!(triangle_counts().last(), Some(1_000_000));
    for (_, law) in Law::CHOICES {
        assert_eq!(steps(*law, 8).len() as u64, sizes(*law), "{law:?}");
    }
}

/// Covered fraction, and mean magnitude of the picture: over black, shadows are below 0.
fn shown(step: Step) -> (f64, f64) {
    let mut renderer =
        Renderer::new(step.scene, RendererOptions::default(), &Watcher::none()).unwrap();
    renderer.set_samples(64, 7, &Watcher::none()).unwrap();
    renderer
        .advance(Budget::Complete, &Watcher::none())
        .unwrap();
    let film: &Film = renderer.film();
    let pixels = film.pixels.len() as f64;
    let covered = film
        .pixels
        .iter()
        .map(|p| f64::from(p.m) / f64::from(p.n.max(1)));
    let linear = renderer.picture().linear;
    let light = linear.iter().flatten().map(|&x| f64::from(x.abs()));
    (
        covered.sum::<f64>() / pixels,
        light.sum::<f64>() / (3.0 * pixels),
    )
}

/// More objects that covered more, or more lights that lit more, would measure something else. Control: balls larger
/// by 3%.
#[test]
fn what_is_held_is_held() {
    let of = |law: Law, index: usize| shown(steps(law, 4).swap_remove(index));
    let (one, many) = (of(Law::Objects, 0), of(Law::Objects, 3));
    let covered = one.0;
    assert!(
        (many.0 / one.0 - 1.0).abs() < 0.03,
        "{} and {}",
        many.0,
        one.0
    );
    let (one, many) = (of(Law::Lights, 0), of(Law::Lights, 3));
    assert!(
        (many.1 / one.1 - 1.0).abs() < 0.02,
        "{} and {}",
        many.1,
        one.1
    );
    assert!(one.1 > 0.01, "something is lit: {}", one.1);
    let mut larger = steps(Law::Objects, 4).swap_remove(3);
    for ball in larger
        .scene
        .objects
        .iter_mut()
        .filter(|o| o.side == Side::Virtual)
    {
        ball.world_from_object *= glam::DMat4::from_scale(DVec3::splat(1.03));
    }
    let control = shown(larger).0 / covered;
    assert!((control - 1.0).abs() > 0.03, "{control}");
    let (few, many) = (of(Law::Triangles, 1), of(Law::Triangles, 4));
    assert!(
        (many.0 / few.0 - 1.0).abs() < 0.02,
        "{} and {}",
        many.0,
        few.0
    );
}
