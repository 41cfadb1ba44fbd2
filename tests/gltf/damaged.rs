//! Sample models damaged at random: an error of one line or a clean scene, and never a panic or a hang.

use super::bad_inputs::{check_outcome, load_guarded};
use crate::faults::fuzz::mutate::{Random, glb_bytes, glb_value};
use crate::support::shared_data;

#[test]
fn damaged_files_never_panic() {
    let Some(root) = shared_data("gltf_models") else {
        return;
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("damaged.glb");
    for (kind, damage) in [
        ("bytes", glb_bytes as fn(&[u8], &mut Random) -> Vec<u8>),
        ("values", glb_value),
    ] {
        let mut random = Random::new(1);
        let (mut loaded, mut refused) = (0, 0);
        for name in ["BoxInterleaved.glb", "BoxTextured.glb", "box_sparse.glb"] {
            let whole = std::fs::read(root.join(name)).unwrap();
            for round in 0..700 {
                std::fs::write(&path, damage(&whole, &mut random)).unwrap();
                let outcome = load_guarded(&path);
                check_outcome(&path, &outcome)
                    .unwrap_or_else(|reason| panic!("{name}, {kind}, round {round}: {reason}"));
                match outcome {
                    Ok(_) => loaded += 1,
                    Err(_) => refused += 1,
                }
            }
        }
        assert!(
            loaded > 100 && refused > 100,
            "{kind}: {loaded} loaded, {refused} refused"
        );
    }
}
