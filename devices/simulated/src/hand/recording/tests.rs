//! Recorded trajectories: interpolation between samples, and files without a trajectory.

use super::*;
use proptest::prelude::*;
use std::io::Cursor;

fn table(text: &str) -> Result<Recording, String> {
    table::read(text).map_err(|wrong| wrong.in_file("t")).and_then(Recording::new)
}

#[test]
fn between_samples_the_hand_aims_straight_and_outside_it_stays() {
    let recording = table("time_s, x_m, y_m, z_m\n7, 0, 0, 0\n7.5, 0.001, 0, -0.004\n8, 0.001, 0, -0.002\n")
        .expect("a table");
    let at_m = |time_ms: u64| recording.aim(time_ms * 1_000_000).pose.position_m;
    assert_eq!(at_m(0), DVec3::ZERO);
    assert!((at_m(250) - DVec3::new(0.5e-3, 0.0, -2.0e-3)).length() < 1.0e-18);
    assert!((at_m(750) - DVec3::new(1.0e-3, 0.0, -3.0e-3)).length() < 1.0e-18);
    assert_eq!(at_m(99_000), DVec3::new(1.0e-3, 0.0, -2.0e-3));
    assert_eq!(recording.end_ns(), 1_000_000_000);
}

#[test]
fn rotations_are_followed_too() {
    let recording = table("time_s,x_m,y_m,z_m,rx_rad,ry_rad,rz_rad\n0,0,0,0,0,0,0\n1,0,0,0,0.1,0,0\n");
    let halfway = recording.expect("a table").aim(500_000_000).pose.orientation;
    // Halfway along the chord is halfway along the arc.
    assert!((halfway * DQuat::from_rotation_x(-0.05)).xyz().length() < 1.0e-15, "{halfway}");
}

#[test]
fn complaints_name_the_line_and_the_column() {
    for (text, expected) in [
        ("", "t:1: the table is empty; write a header and at least one row"),
        ("t,x,y,z\n0,0,0,0\n", "t:1: the columns must be time_s,x_m,y_m,z_m or time_s,"),
        ("time_s,x_m,y_m,z_m\n", "the file has no pose"),
        ("time_s,x_m,y_m,z_m\n0,0,0,0\n1,0,up,0\n", "t:3: `y_m` must be a number, not `up`"),
        ("time_s,x_m,y_m,z_m\n0,0,0,0\n0,0,0,0\n", "t:3: the time 0 s after the first pose is not above 0 s"),
        ("time_s,x_m,y_m,z_m\n0,0,0,nan\n", "t:2: `z_m` must be finite"),
        ("time_s,x_m,y_m,z_m\n0,0,0,4\n", "t:2: [0, 0, 4] m is farther than 0.12 m from home"),
        ("time_s,x_m,y_m,z_m\n0,0,0\n", "t:2: the line has 3 cells for 4 columns"),
    ] {
        let problem = table(text).expect_err("refused");
        assert!(problem.starts_with(expected), "{problem}, not {expected}");
    }
    assert!(mcap_file::read(Cursor::new(b"no such thing")).is_err());
    assert!(Recording::load(Path::new("/no/such/file.csv")).is_err());
}

proptest! {
    /// Whatever the bytes, they are a trajectory of finite poses or a complaint.
    #[test]
    fn any_bytes_are_a_trajectory_or_a_complaint(
        mut bytes in prop_oneof![
            prop::collection::vec(any::<u8>(), 0..200),
            "time_s,x_m,y_m,z_m\n([0-9.e,-]{0,12}\n){0,5}".prop_map(String::into_bytes),
        ],
        as_mcap in any::<bool>(),
    ) {
        if as_mcap {
            bytes.splice(0..0, mcap::MAGIC.iter().copied());
        }
        let text = String::from_utf8_lossy(&bytes);
        let read = if as_mcap {
            mcap_file::read(Cursor::new(&bytes))
        } else {
            table::read(&text).map_err(|wrong| wrong.problem)
        };
        if let Ok(recording) = read.and_then(Recording::new) {
            for time_ns in [0, recording.end_ns() / 3, recording.end_ns(), u64::MAX] {
                let pose = recording.aim(time_ns).pose;
                prop_assert!(pose.position_m.is_finite() && pose.orientation.is_finite());
            }
        }
    }
}
