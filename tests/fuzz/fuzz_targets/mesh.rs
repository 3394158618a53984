//! Any bytes are a mesh, or are refused with a place, and never panic; a ball that falls onto a mesh that is accepted feels finite
//! forces. The first byte chooses the format. Starts from the files in `seeds/mesh`.
#![no_main]

use flotor_hal::DVec3;
use flotor_surface::material::Material;
use flotor_surface::object::{Reading, Unit, read};
use flotor_surface::touch::{Materials, Touch};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let Some((first, rest)) = bytes.split_first() else { return };
    let name = ["m.stl", "m.obj", "m.ply", "m.glb"][usize::from(*first) % 4];
    let reading = Reading { unit: Unit::Auto, scale: 1.0, edge_angle_rad: 0.5 };
    let object = match read(name, rest.to_vec(), &reading) {
        Ok(object) => object,
        Err(error) => return assert!(!error.to_string().is_empty()),
    };
    let common = Material {
        stiffness_n_per_m: 1000.0,
        damping_ns_per_m: 1.0,
        static_friction: 0.5,
        kinetic_friction: 0.4,
        viscous_ns_per_m: 1.0,
    };
    let materials = Materials { common, own: Vec::new() };
    let [low, high] = object.surface.box_m();
    let mut touch = Touch::new(1.0e-3);
    for i in 0..20 {
        let tool_m = (high + DVec3::splat(0.01)).lerp(low, f64::from(i) / 20.0);
        let answer = touch.step(&object.surface, &materials, tool_m, DVec3::Z);
        assert!(answer.force_n.is_finite() && answer.energy_j.is_finite());
    }
});
