use super::*;

/// Landings on the floor in a square cell of that side about the origin, of light that comes from `source` by way of a surface at height `height`.
fn landings(source: Vec3, height: f32, side: f32) -> impl Iterator<Item = Landing> {
    (0..64).map(move |i| {
        let position =
            side * Vec3::new((i % 8) as f32 / 7.0 - 0.5, 0.0, (i / 8) as f32 / 7.0 - 0.5);
        let towards = source - position;
        let from = position + towards * (height / towards.y);
        Landing { position, from }
    })
}

/// The widest angle between a lobe's axis and the direction of a landing that it is the nearest to, radians.
fn farthest_landing(landings: &[Landing], lobes: &[[f32; 4]]) -> f32 {
    let targets: Vec<Vec3> = lobes.iter().map(|lobe| Vec3::from_slice(lobe)).collect();
    let (nearest, farthest) = nearest_targets(landings, &targets);
    nearest[farthest].1
}

#[test]
fn a_lobe_aims_at_the_image_behind_the_mirror() {
    let image = Vec3::new(0.3, 2.0, -0.2);
    let seen: Vec<Landing> = landings(image, 1.0, 0.5).collect();
    let found = lobes(&seen, 0.0);
    assert_eq!(found.len(), 1);
    assert!(
        Vec3::from_slice(&found[0]).distance(image) < 0.01,
        "{found:?}"
    );
    assert!(farthest_landing(&seen, &found) < 0.01);
    // Control: from the surface itself the directions of the same landings are far apart.
    let mean = seen.iter().map(|landing| landing.from).sum::<Vec3>() / seen.len() as f32;
    assert!(farthest_landing(&seen, &[mean.extend(0.0).to_array()]) > 0.1);
}

#[test]
fn two_images_get_a_lobe_each() {
    let images = [Vec3::new(1.0, 2.0, 0.0), Vec3::new(-1.0, 1.5, 0.5)];
    let seen: Vec<Landing> = (images.into_iter())
        .flat_map(|image| landings(image, 0.5, 0.2))
        .collect();
    let found = lobes(&seen, 0.0);
    assert!(found.len() >= 2, "{found:?}");
    for image in images {
        let near = |lobe: &[f32; 4]| {
            Vec3::from_slice(lobe)
                .normalize()
                .distance(image.normalize())
                < 0.05
        };
        assert!(found.iter().any(near), "{image} in {found:?}");
    }
}

/// Light that comes from everywhere: targets lose their landings to each other (by a count of targets, cell 171 would never end), and yet there is an end.
#[test]
fn scattered_light_comes_to_an_end() {
    let number = |i: u32| crate::math::uniform_from_bits(crate::math::hash_u32(i)) - 0.5;
    for cell in 0..200 {
        let vector = |i: u32| Vec3::new(number(i), number(i + 1), number(i + 2));
        let seen: Vec<Landing> = (0..10)
            .map(|i| Landing {
                position: vector(1000 * cell + 6 * i),
                from: vector(1000 * cell + 6 * i + 3),
            })
            .collect();
        let found = lobes(&seen, 0.1);
        assert!((1..=GUIDE_LOBES as usize).contains(&found.len()));
        assert!(found.iter().flatten().all(|number| number.is_finite()));
    }
}
