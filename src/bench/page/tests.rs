use super::*;
use crate::bench::record::test_support::report;
use crate::film::Picture;

#[test]
fn the_page_shows_everything_and_asks_for_nothing() {
    let report = report();
    let picture = |grey: f32| Picture {
        width: 4,
        height: 3,
        linear: vec![[grey; 3]; 12],
    };
    let scene = report.rows[0].scene.clone();
    let shots: Vec<Shot> = report
        .rows
        .iter()
        .map(|row| Shot {
            scene: scene.clone(),
            method: row.method,
            rays_per_pixel: row.rays_per_pixel,
            picture: picture(0.5),
        })
        .collect();
    let truth = Truth {
        picture: picture(0.4375),
        standard_error: vec![[0.0; 3]; 12],
        mask: vec![0.0; 12],
    };
    let truths = [(scene, Composite::Additive, truth)];
    let plots = crate::bench::plots(&report).unwrap();
    let page = page(&report, &plots, &shots, &truths).unwrap();
    // A reference, two pictures, two differences.
    assert_eq!(page.matches("data:image/png;base64,").count(), 5);
    assert_eq!(page.matches("<svg").count(), 2);
    assert!(
        page.contains("times 2 about grey"),
        "an eighth over a sixteenth"
    );
    assert!(page.contains("a &lt;b&gt;") && !page.contains("a <b>"));
    let outside = page.replace("http://www.w3.org/2000/svg", "");
    assert!(!outside.contains("http"), "nothing is fetched");
    let mut with_goal = shots.clone();
    with_goal.extend(shots.iter().map(|shot| Shot {
        method: crate::bench::Method {
            goal: Some(crate::bench::Goal {
                aim: crate::bench::Aim::TargetError(0.1),
                max_rays_per_pixel: 1024,
            }),
            ..shot.method
        },
        rays_per_pixel: 1024,
        scene: shot.scene.clone(),
        picture: picture(0.9),
    }));
    let page_with_goal = super::page(&report, &plots, &with_goal, &truths).unwrap();
    assert!(page_with_goal.contains("at most 1024"));
    assert!(
        page_with_goal.contains("times 2 about grey"),
        "by the shots of a number of rays alone"
    );
    for tag in ["table", "ul", "div", "pre", "svg", "td", "tr"] {
        let (open, close) = (format!("<{tag}"), format!("</{tag}>"));
        assert_eq!(
            page.matches(&open).count(),
            page.matches(&close).count(),
            "{tag}"
        );
    }
}
