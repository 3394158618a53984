//! A file without an end, or without an answer, in place of every input file: refused at once, in one line that names it.

use flotor_tests::program::{Flotor, exit_code};
use flotor_tests::scratch::Scratch;
use rayon::prelude::*;
use std::process::Command;

/// Every command that reads a file, with `FILE` in its place; `PLUGIN` and `CALIBRATION` are scenes that
/// name it, and `TEST` is a test of it.
const DOORS: [&[&str]; 28] = [
    &["run", "FILE"],
    &["run", "PLUGIN"],
    &["replay", "FILE"],
    &["test", "FILE"],
    &["test", "TEST"],
    &["repair", "FILE", "--out", "whole.mcap"],
    &["view", "FILE"],
    &["validate", "FILE"],
    &["plugins", "FILE"],
    &["eval", "--model", "spring", "--poses", "FILE"],
    &["eval", "--model", "FILE", "--poses", "POSES"],
    &["eval", "--model", "measured", "--set", "curve=FILE", "--poses", "POSES"],
    &["eval", "--model", "membrane", "--set", "file=FILE", "--poses", "POSES"],
    &["eval", "--model", "solid", "--set", "body=file", "--set", "file=FILE", "--poses", "POSES"],
    &["run", "--clock", "virtual", "--duration", "10ms", "--set", "device.hand_recording=FILE"],
    &["run", "--clock", "virtual", "--duration", "10ms", "--set", "device.hand_script=FILE"],
    &["run", "CALIBRATION"],
    &["calibrate", "verify", "FILE", "--simulated"],
    &["identify", "FILE"],
    &["identify", "FILE", "--law", "linear"],
    &["study", "run", "FILE"],
    &["analyse", "FILE"],
    &["study", "spring", "FILE"],
    &["study", "jnd", "--scene", "FILE", "--out", "scene"],
    &["study", "explore", "--scene", "FILE"],
    &["study", "jnd", "--observer", "human", "--out", "texts", "--texts", "FILE"],
    &["study", "jnd", "--observer", "human", "--out", "consent", "--consent", "FILE"],
    &["study", "jnd", "--observer", "human", "--out", "how", "--instructions", "FILE"],
];

#[test]
fn a_pipe_or_a_device_file_is_refused_in_place_of_every_input() {
    let scratch = Scratch::default();
    let pipe = scratch.path().join("pipe").display().to_string();
    assert!(Command::new("mkfifo").arg(&pipe).status().is_ok_and(|made| made.success()));
    let poses = scratch.file("poses.csv", "x_m,y_m,z_m,rx_rad,ry_rad,rz_rad\n0,0,-0.005,0,0,0\n");
    let poses = poses.display().to_string();
    let endless = ["/dev/zero", pipe.as_str()];
    let tries: Vec<(&[&str], &str)> =
        DOORS.iter().flat_map(|door| endless.iter().map(|file| (*door, *file))).collect();
    let wrong: Vec<String> = tries
        .into_par_iter()
        .filter_map(|(door, file)| {
            let scenes = Scratch::default();
            let scene = |name: &str, lines: String| scenes.file(name, lines).display().to_string();
            let arguments = door.iter().map(|word| match *word {
                "PLUGIN" => scene(
                    "plugin.toml",
                    format!("[device]\nplugin = \"simulated\"\n[[model]]\nplugin = \"{file}\"\n"),
                ),
                "CALIBRATION" => scene(
                    "calibration.toml",
                    format!(
                        "[device]\nplugin = \"simulated\"\ncalibration = \"{file}\"\n[[model]]\nplugin = \"spring\"\n"
                    ),
                ),
                "TEST" => scene("named.test.toml", format!("scene = \"{file}\"\n")),
                word => word.replace("FILE", file).replace("POSES", &poses),
            });
            let arguments: Vec<String> = arguments.collect();
            // Four gigabytes of addresses, twenty seconds: what reads on or waits fails here.
            let ran = Flotor::with(&arguments)
                .through_shell("ulimit -v 4000000; exec timeout -s KILL 20 \"$@\"")
                .inside(scratch.path())
                .run();
            let refused = ran.code.is_some_and(|code| (1..=4).contains(&code));
            let says = ran.stderr.lines().any(|line| line.starts_with("error: ") && line.contains(file));
            (!refused || !says).then(|| format!("{arguments:?}: {:?} {}", ran.code, ran.stderr))
        })
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn a_stack_that_is_too_small_is_refused_in_one_line() {
    let ran = Flotor::with(["plugins"]).through_shell("ulimit -s 256; exec \"$@\"").run();
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:?}");
    assert!(ran.stderr.starts_with("error: the stack limit of 256 kB is too small"), "{}", ran.stderr);
    assert_eq!(ran.stderr.lines().count(), 1, "{}", ran.stderr);
}

#[test]
fn without_proc_the_cause_is_named() {
    let without = "exec unshare -m sh -c 'umount -l /proc && exec \"$@\"' sh \"$@\"";
    let can = Command::new("unshare").args(["-m", "umount", "-l", "/proc"]).output();
    if !can.is_ok_and(|output| output.status.success()) {
        println!("skipped: only the superuser takes /proc away");
        return;
    }
    let ran = Flotor::with(["plugins"]).through_shell(without).run();
    assert!(ran.stdout.contains("because /proc is not mounted"), "{ran:?}");
}

#[test]
fn a_scene_has_a_bounded_number_of_models() {
    let scratch = Scratch::default();
    let model = |number| format!("[[model]]\nplugin = \"wall\"\nname = \"w{number}\"\n");
    let models: String = (0..20_000).map(model).collect();
    let scene = scratch.file("many.toml", format!("[device]\nplugin = \"simulated\"\n{models}"));
    let ran = Flotor::with(["run", &scene.display().to_string()]).run();
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:?}");
    assert!(ran.stderr.contains("many.toml:12292: there are more than 4096 models"), "{}", ran.stderr);
}

/// A measured spring as spreadsheets write it: a plain table, Excel's "CSV UTF-8" (mark and line ends), and Excel in German.
fn of_spreadsheets() -> [String; 3] {
    let rows = (0..=40).map(|row| format!("{:?},{:?}\n", f64::from(row) * 0.25, f64::from(row) / 10.0));
    let plain = format!("compression_mm,force_n\n{}", rows.collect::<String>());
    let marked = format!("\u{feff}{}", plain.replace('\n', "\r\n"));
    let german = plain.replace(',', ";").replace('.', ",");
    [plain, marked, german]
}

/// Every reader of a table takes the mark and the line ends, and names the separator that it does not take.
#[test]
fn tables_of_spreadsheets_are_read_or_refused_with_the_separator() {
    let scratch = Scratch::default();
    let poses = scratch.file("poses.csv", "x_m,y_m,z_m,rx_rad,ry_rad,rz_rad\n0,0,-0.005,0,0,0\n");
    let poses = poses.display().to_string();
    let commands: [&[&str]; 2] = [
        &["study", "spring", "spring.csv"],
        &["eval", "--model", "measured", "--set", "curve=spring.csv", "--poses", &poses, "--out", "-"],
    ];
    for command in commands {
        let [plain, marked, german] = of_spreadsheets().map(|table| {
            let folder = Scratch::default();
            let _ = folder.file("spring.csv", table);
            Flotor::with(command).inside(folder.path()).run()
        });
        assert_eq!(plain.code, Some(exit_code::OK), "{plain:?}");
        assert_eq!(marked, plain, "{command:?}");
        assert_eq!(german.code, Some(exit_code::CONFIGURATION), "{german:?}");
        assert!(german.error().contains("spring.csv") && german.error().contains("`;`"), "{german:?}");
    }
}
