//! Loads model plugins from files and steps each through a hundred poses: a host reduced to its use of plugins.
//!
//! `cargo run -p flotor-loader --example load_model -- target/debug/libflotor_wall.so`
//!
//! Prints one line per file: id, version, last force and a checksum of all wrenches, or the reason why the file was
//! rejected. The same model prints the same line on every system.

#![allow(unsafe_code)] // a plugin file is loaded: its user trusts it

use flotor_hal::{Input, LoopConfig, Output, Pose};
use flotor_loader::{LoadError, Plugin};
use std::path::Path;

const POSES: u32 = 100;

fn main() {
    let files: Vec<_> = std::env::args_os().skip(1).collect();
    if files.is_empty() {
        eprintln!("usage: load_model PLUGIN_FILE...");
        std::process::exit(2);
    }
    for file in files {
        match ask(Path::new(&file)) {
            Ok(line) => println!("{line}"),
            // Replaces the path by `it`, so that the line does not depend on the machine.
            Err(error) => println!("refused: {}", error.to_string().replace(&*file.to_string_lossy(), "it")),
        }
    }
}

fn ask(file: &Path) -> Result<String, LoadError> {
    // SAFETY: whoever names a file on the command line trusts it, as a program that is started.
    let plugin = unsafe { Plugin::load(file) }?;
    let mut model = plugin.create_model(&[])?;
    if let Err(refusal) = model.prepare(&LoopConfig { period_ns: 1_000_000, seed: 1 }) {
        return Ok(format!("{}: {refusal}", plugin.metadata().id));
    }
    let (mut output, mut sum) = (Output::default(), 0_u64);
    for number in 0..POSES {
        let part = f64::from(number) / f64::from(POSES);
        // Down by 10 mm, aside by 3 mm, in a straight line.
        let pose = Pose { position_m: [0.003 * part, -0.001 * part, -0.010 * part], ..Pose::HOME };
        model.step(&Input::at_rest(pose), &mut output);
        let components = output.wrench.force_n.iter().chain(&output.wrench.torque_nm);
        sum = components.fold(sum, |sum, component| sum.rotate_left(7) ^ component.to_bits());
    }
    let last: Vec<String> = output.wrench.force_n.iter().map(|force_n| format!("{force_n:.6}")).collect();
    let facts = plugin.metadata();
    Ok(format!("{} {}: last force {} N, bits of all {sum:016x}", facts.id, facts.version, last.join(" ")))
}
