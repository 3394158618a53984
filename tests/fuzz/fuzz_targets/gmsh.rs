//! Any text is a mesh, or is refused with a line or a place, and never panics; a small body that is accepted can be solved, or is
//! refused too. Starts from the files in `seeds/gmsh`.
#![no_main]

use flotor_solid::description::{Body, Description, Tool};
use flotor_solid::gmsh;
use flotor_solid::law::Law;
use flotor_solid::mesh::Mesh;
use flotor_solid::remainder::Resolution;
use libfuzzer_sys::fuzz_target;

/// Larger bodies are read and not solved: a case takes milliseconds.
const MOST_SOLVED: usize = 100;

fuzz_target!(|bytes: &[u8]| {
    let text = String::from_utf8_lossy(bytes);
    let parts = match gmsh::read(&text) {
        Ok(parts) => parts,
        Err(error) => {
            assert!(error.line <= text.lines().count().max(1), "{error}");
            return;
        }
    };
    let mesh = match Mesh::new(parts, "fixed", "touched") {
        Ok(mesh) => mesh,
        Err(error) => return assert!(!error.to_string().is_empty()),
    };
    assert!(mesh.nodes_m.iter().flatten().all(|x| x.is_finite()));
    if mesh.nodes_m.len() <= MOST_SOLVED {
        let body = Body::File { digest: 0 };
        let resolution = Resolution::QUICK;
        let description = Description { body, tool: Tool::Plate, poisson_ratio: 0.3, resolution };
        if let Ok((Law::Bonded(patch), _)) = description.solve_on(&mesh) {
            assert!(patch.stiffness.iter().flatten().all(|x| x.is_finite()));
        }
    }
});
