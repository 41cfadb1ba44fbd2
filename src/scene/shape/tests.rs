use super::*;

fn corners(primitive: &Primitive) -> impl Iterator<Item = [DVec3; 3]> + '_ {
    primitive.triangles.iter().map(|triangle| {
        triangle.map(|index| {
            let [x, y, z] = primitive.positions[index as usize].map(f64::from);
            DVec3::new(x, y, z)
        })
    })
}

/// Six times the signed volume over all triangles: closed and outward if it is the solid's.
fn volume(primitive: &Primitive) -> f64 {
    corners(primitive)
        .map(|[a, b, c]| a.dot(b.cross(c)))
        .sum::<f64>()
        / 6.0
}

#[test]
fn a_sphere_is_closed_round_and_faces_outward() {
    let sphere = sphere(256);
    // Inscribed, so a little less than the ball.
    let missing = 1.0 - volume(&sphere) / (4.0 / 3.0 * PI);
    assert!((0.0..1e-3).contains(&missing), "{missing}");
    let mut edges = std::collections::HashMap::new();
    for triangle in corners(&sphere) {
        // The poles hold zeros of both signs.
        let key = |point: DVec3| point.to_array().map(|x| (x + 0.0).to_bits());
        assert!(
            (triangle[1] - triangle[0])
                .cross(triangle[2] - triangle[0])
                .length()
                > 0.0
        );
        for i in 0..3 {
            let (a, b) = (key(triangle[i]), key(triangle[(i + 1) % 3]));
            *edges.entry((a, b)).or_insert(0) += 1;
            *edges.entry((b, a)).or_insert(0) -= 1;
        }
    }
    assert!(edges.values().all(|balance| *balance == 0));
    for (position, normal) in sphere.positions.iter().zip(&sphere.normals) {
        assert_eq!(position, normal);
    }
}

#[test]
fn a_box_has_its_volume_and_faces_outward() {
    let cuboid = cuboid(DVec3::new(1.0, 2.0, 3.0));
    assert!((volume(&cuboid) - 6.0).abs() < 1e-6);
    for (triangle, points) in cuboid.triangles.iter().zip(corners(&cuboid)) {
        let [x, y, z] = cuboid.normals[triangle[0] as usize].map(f64::from);
        let normal = (points[1] - points[0])
            .cross(points[2] - points[0])
            .normalize();
        assert!((normal - DVec3::new(x, y, z)).length() < 1e-6);
    }
}

/// Negative control: turning one triangle round is noticed by the volume.
#[test]
fn a_flipped_triangle_changes_the_volume() {
    let mut cuboid = cuboid(DVec3::ONE);
    cuboid.triangles[0].swap(0, 1);
    assert!((volume(&cuboid) - 1.0).abs() > 0.1);
}
