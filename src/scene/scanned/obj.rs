//! Wavefront OBJ: `v` and `f` lines; the others are passed over.

use super::{Mesh, Result, fan};

pub(super) fn read(bytes: &[u8]) -> Result<Mesh> {
    let mut mesh = Mesh::default();
    let mut corners: Vec<u32> = Vec::new();
    for (index, line) in bytes.split(|byte| *byte == b'\n').enumerate() {
        // Names and comments may be in any encoding.
        let Ok(line) = std::str::from_utf8(line) else {
            continue;
        };
        let mut words = line.split_ascii_whitespace();
        match words.next() {
            Some("v") => {
                let mut position = [0.0; 3];
                for value in &mut position {
                    let number = words.next().and_then(|word| word.parse::<f32>().ok());
                    *value = number.ok_or_else(|| {
                        at(index, "a vertex without three numbers; expected `v x y z`")
                    })?;
                }
                mesh.positions.push(position);
            }
            Some("f") => {
                corners.clear();
                for word in words.take_while(|word| *word != "\\") {
                    let vertices = mesh.positions.len();
                    let vertex = vertex_of(word, vertices).ok_or_else(|| {
                        let problem = format!(
                            "a face asks for `{}` of {vertices} vertices; expected their numbers from 1, or -1 for the last",
                            word.chars().take(40).collect::<String>()
                        );
                        at(index, &problem)
                    })?;
                    corners.push(vertex);
                }
                if corners.len() < 3 {
                    return Err(at(
                        index,
                        "a face with fewer than 3 corners; expected `f a b c`",
                    ));
                }
                fan(&corners, &mut mesh.triangles);
            }
            _ => {}
        }
    }
    Ok(mesh)
}

fn at(index: usize, problem: &str) -> String {
    format!("line {}: {problem}; export the mesh again", index + 1)
}

/// Of "7", "7/1", "7//2" or "-1", from 0.
fn vertex_of(word: &str, vertices: usize) -> Option<u32> {
    let number: i64 = word.split('/').next()?.parse().ok()?;
    let index = match number {
        1.. => number - 1,
        _ if number < 0 => vertices as i64 + number,
        _ => return None,
    };
    u32::try_from(index)
        .ok()
        .filter(|index| (*index as usize) < vertices)
}
