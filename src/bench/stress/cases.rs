//! The table of cases.

use super::{Case, light, pictures, shortcuts, traversal};

const BRUTE_FORCE: &str = "f64 brute force, ray by ray";
const ORACLE: &str = "f64 brute-force renderer, same samples";
const PICTURE: &str = "relative difference of the picture + difference of the mask";
const WRONG_HITS: &str = "hits that differ beyond rounding";

/// Rounding alone leaves 1e-6. What comes on top is meant: within 1e-5 of its distance from the camera, virtual geometry counts as touching
/// real geometry, so that one sample in 1e5 beside a contact is shadowed for the oracle's light; it weighs up to 6e-4 of a quick picture.
const PICTURE_BOUND: f64 = 1e-3;

const fn picture(name: &'static str, what: &'static str) -> Case {
    Case {
        name,
        what,
        oracle: ORACLE,
        quantity: PICTURE,
        bound: PICTURE_BOUND,
        unit: "",
        settings: &[],
        quick_settings: &[],
        slow_settings: None,
        control_at: 0.0,
        counts_non_finite: false,
        run: pictures::scale,
    }
}

const fn rays(name: &'static str, what: &'static str) -> Case {
    Case {
        oracle: BRUTE_FORCE,
        quantity: WRONG_HITS,
        bound: 0.0,
        ..picture(name, what)
    }
}

const fn photons(name: &'static str, what: &'static str) -> Case {
    Case {
        oracle: "albedo E cos / pi",
        quantity: "relative error of the mean",
        bound: 0.05,
        ..picture(name, what)
    }
}

const fn shared(name: &'static str, what: &'static str) -> Case {
    Case {
        oracle: "albedo L (r/d)^2 cos",
        quantity: "relative error of what the ball takes",
        bound: 0.02,
        ..picture(name, what)
    }
}

/// All cases.
pub fn cases() -> Vec<Case> {
    vec![
        Case {
            unit: "m",
            settings: &[1e3, 1e4, 1e5, 1e6, 1e7],
            quick_settings: &[1e3, 1e7],
            control_at: 1e7,
            run: pictures::translation,
            ..picture("translation", "the world and the camera moved, in f64")
        },
        Case {
            unit: "x",
            settings: &[1e-4, 1e-2, 1.0, 1e2, 1e4, 1e6],
            quick_settings: &[1e-4, 1e6],
            control_at: 1e2,
            run: pictures::scale,
            ..picture("scale", "all lengths of the scene scaled")
        },
        Case {
            unit: "x scale",
            settings: &[1e-4, 1.0, 1e6],
            quick_settings: &[1.0],
            control_at: 1.0,
            run: pictures::outlier,
            ..picture("outliers", "a real and a virtual triangle 1e6 times larger")
        },
        Case {
            unit: ": 1",
            settings: &[1e3, 1e6],
            quick_settings: &[1e6],
            control_at: 1e3,
            run: pictures::slivers,
            ..picture("slivers", "a table and a virtual sheet made of slivers")
        },
        Case {
            unit: "degrees",
            settings: &[0.0, 7.0, 23.0],
            quick_settings: &[0.0, 7.0],
            control_at: 7.0,
            run: pictures::coplanar,
            ..picture(
                "coplanar base",
                "a virtual sheet in the plane of the real table, tilted",
            )
        },
        Case {
            unit: "boxes",
            settings: &[3.0, 12.0],
            quick_settings: &[12.0],
            control_at: 3.0,
            run: pictures::interpenetrating,
            ..picture("interpenetrating", "boxes through each other and the table")
        },
        Case {
            unit: "rad",
            settings: &[1e-2, 1e-4, 1e-6],
            quick_settings: &[1e-6],
            control_at: 1e-6,
            run: pictures::grazing,
            ..picture("grazing view", "a table with a box seen at this angle")
        },
        Case {
            unit: "m",
            settings: &[1e-7, 1e-3, 0.1, 1.0],
            quick_settings: &[1e-7, 1.0],
            control_at: 0.1,
            run: pictures::aperture,
            ..picture("aperture", "the radius of the lens")
        },
        Case {
            unit: "m",
            settings: &[1e-3, 0.1, 3.0, f64::INFINITY],
            quick_settings: &[1e-3, f64::INFINITY],
            control_at: f64::INFINITY,
            run: pictures::focus,
            ..picture("focus", "the distance of the focus plane")
        },
        Case {
            unit: "W/sr/m2",
            settings: &[1e-8, 1e-4, 1.0, 1e4, 1e8],
            quick_settings: &[1e-8, 1e8],
            control_at: 1.0,
            oracle: "quadrature of the texel in f64",
            quantity: "relative error of the sunlit and of the shadowed part",
            bound: 1e-3,
            run: light::one_pixel_sun,
            ..picture("one-pixel sun", "a sky of one bright texel")
        },
        Case {
            unit: "x",
            settings: &[1e-4, 1.0, 1e6],
            quick_settings: &[1e-4, 1e6],
            control_at: 1.0,
            oracle: "albedo L (r/d)^2 cos",
            quantity: "relative error of the shadow under an even sky",
            bound: 5e-3,
            run: light::form_factor,
            ..picture("black ball", "a black ball over a plane, scaled and moved")
        },
        Case {
            unit: "m",
            settings: &[1e-4, 1e-2, 1.0],
            quick_settings: &[1e-4],
            control_at: 1.0,
            run: shortcuts::at_the_lens,
            ..photons(
                "photons at the lens",
                "a wall so far from the lens plane, lit by a mirror",
            )
        },
        Case {
            unit: "m",
            settings: &[1e3, 1e5],
            quick_settings: &[1e5],
            control_at: 1e5,
            run: shortcuts::moved_photons,
            ..photons("photons moved", "the same, the world and the camera moved")
        },
        Case {
            unit: "photons",
            settings: &[10.0, 30.0],
            quick_settings: &[10.0],
            control_at: 30.0,
            bound: 0.5,
            run: shortcuts::few_pilot_photons,
            ..photons(
                "few pilot photons",
                "the same, the pilot seeing about as many photons",
            )
        },
        Case {
            unit: "x",
            settings: &[10.0, 1e2, 1e4],
            quick_settings: &[1e4],
            control_at: 10.0,
            run: shortcuts::apart,
            ..shared(
                "sharing across depths",
                "pixels of a tile so many times nearer than others",
            )
        },
        Case {
            unit: "rad",
            settings: &[0.1, 1e-2, 1e-3],
            quick_settings: &[1e-3],
            control_at: 1e-2,
            run: shortcuts::grazing_links,
            ..shared(
                "grazing links",
                "a ball over the floor, seen from it at this angle",
            )
        },
        Case {
            settings: &[0.0, 1e-4],
            quick_settings: &[0.0, 1e-4],
            control_at: 0.0,
            run: pictures::roughness,
            ..picture("roughness", "mirrors of this roughness in one another")
        },
        Case {
            settings: &[1.0, 1.0001],
            quick_settings: &[1.0, 1.0001],
            control_at: 1.0001,
            run: pictures::index_of_refraction,
            ..picture("index of refraction", "a clear box before a striped wall")
        },
        Case {
            unit: "samples",
            settings: &[1e4, 1e6],
            quick_settings: &[1e6],
            slow_settings: Some([&[1e5], &[1e4, 1e6]]),
            control_at: 1e6,
            oracle: "the value itself",
            quantity: "relative error of the mean",
            bound: 1e-7,
            run: light::many_samples,
            ..picture("many samples", "samples of one value on one pixel")
        },
        Case {
            unit: "rays",
            settings: &[1e8],
            quick_settings: &[1e6],
            slow_settings: Some([&[1e5], &[1e7]]),
            control_at: 1e5,
            oracle: "none can miss",
            quantity: "rays that miss",
            run: traversal::shared_edges,
            ..rays(
                "shared edges",
                "rays from inside six closed meshes at edges and vertices",
            )
        },
        Case {
            unit: "x",
            settings: &[1e-4, 1e-2, 1e2, 1e4, 1e6],
            quick_settings: &[1e-4, 1e6],
            control_at: 1e-4,
            run: traversal::soup_at_scale,
            ..rays("hits at scale", "random triangles, scaled")
        },
        Case {
            unit: "x scale",
            settings: &[1e-4, 1.0, 1e6],
            quick_settings: &[1.0],
            control_at: 1.0,
            run: traversal::soup_beside_an_outlier,
            ..rays(
                "hits beside outliers",
                "random triangles and two 1e6 times larger",
            )
        },
        Case {
            unit: ": 1",
            settings: &[1e3, 1e4, 1e5, 1e6],
            quick_settings: &[1e3, 1e6],
            control_at: 1e3,
            run: traversal::sliver_soup,
            ..rays("hits on slivers", "random long triangles")
        },
        Case {
            unit: "rad",
            settings: &[1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6],
            quick_settings: &[1e-3, 1e-6],
            control_at: 1e-3,
            run: traversal::grazing_rays,
            ..rays(
                "grazing rays",
                "rays that graze a tilted sheet of triangles",
            )
        },
        Case {
            unit: "(0 empty, 1 real)",
            settings: &[0.0, 1.0],
            quick_settings: &[0.0, 1.0],
            control_at: 1.0,
            oracle: "the photograph, bit for bit",
            quantity: "pixels that changed",
            bound: 0.0,
            run: light::nothing_virtual,
            ..picture("nothing virtual", "a photograph without virtual objects")
        },
        Case {
            settings: &[0.0],
            quick_settings: &[0.0],
            control_at: 0.0,
            run: pictures::nothing_real,
            ..picture("nothing real", "virtual boxes alone")
        },
        Case {
            unit: "(0 real, 1 virtual, 2 both)",
            settings: &[0.0, 1.0, 2.0],
            quick_settings: &[2.0],
            control_at: 2.0,
            run: pictures::one_triangle,
            ..picture("one triangle", "worlds of one triangle")
        },
        Case {
            unit: "triangles",
            settings: &[2.0, 1e5],
            quick_settings: &[1e5],
            // Each ray asks all of them, and Mesa's software device ends an invocation's loops after 65,535 rounds in all.
            slow_settings: Some([&[1e4], &[2.0, 1e4]]),
            control_at: 2.0,
            run: pictures::identical,
            ..picture("identical triangles", "as many at one place")
        },
        Case {
            unit: "W/sr/m2",
            settings: &[1e16, 1e30],
            quick_settings: &[1e30],
            control_at: 1e30,
            oracle: "the samples that meet it",
            quantity: "samples neither counted nor named",
            bound: 0.0,
            counts_non_finite: true,
            run: light::counted_samples,
            ..picture(
                "beyond the sums",
                "an emitter brighter than sums can hold (1e15)",
            )
        },
    ]
}
