//! Times the model's batch call from Rust, as reference for `bench/batch.py`. Prints the time of the fastest round, s.
//!
//! Usage: batch_seconds PLUGIN.so POSES ROUNDS

use flotor_hal::{DVec3, Input, Output, Pose, orientation_from_rotation_vector};
use std::path::Path;
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [plugin, poses, rounds] = arguments.as_slice() else {
        return Err("usage: batch_seconds PLUGIN.so POSES ROUNDS".into());
    };
    let (poses, rounds): (u32, u32) = (poses.parse()?, rounds.parse()?);
    let mut model = flotor_session::registry::load_file(Path::new(plugin))?.create_model(&[])?;
    // The same path as in `bench/batch.py`: a sine of 10 mm, a little shear and tilt.
    let inputs: Vec<Input> = (0..poses)
        .map(|i| {
            let phase = f64::from(i) * 1.0e-3;
            let position = DVec3::new(1.0e-3 * phase.cos(), 0.0, -5.0e-3 + 5.0e-3 * phase.sin());
            let rotation = DVec3::new(0.0, 0.01 * phase.sin(), 0.0);
            Input::at_rest(Pose::new(position, orientation_from_rotation_vector(rotation)))
        })
        .collect();
    let mut outputs = vec![Output::default(); inputs.len()];
    let mut best_s = f64::INFINITY;
    for _ in 0..rounds {
        let started = Instant::now();
        model.step_batch(&inputs, &mut outputs);
        best_s = best_s.min(started.elapsed().as_secs_f64());
    }
    println!("{best_s:.9}");
    Ok(())
}
