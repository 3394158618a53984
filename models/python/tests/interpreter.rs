//! Answers and failures of the interpreter: an exception, an invalid answer, a process that is killed or hangs.

#[path = "../../../tests/src/tools.rs"]
#[allow(dead_code, unreachable_pub)] // the other tests use the rest
mod tools;

use flotor_hal::{DVec3, Input, Pose, orientation_from_rotation_vector};
use flotor_python_model::interpreter::Interpreter;
use flotor_python_model::message::VALUES;
use std::path::PathBuf;
use std::time::{Duration, Instant};

const NONE: [f64; VALUES] = [0.0; VALUES];

/// Writes a model file; `None` without Python.
fn file(name: &str, source: &str) -> Option<PathBuf> {
    tools::required(tools::Tool::Python).then_some(())?;
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR"));
    let path = folder.join(format!("{name}.py"));
    std::fs::write(&path, format!("from flotor_model import *\n{source}")).expect("a folder for tests");
    Some(path)
}

fn started(path: &std::path::Path) -> Interpreter {
    Interpreter::start(path, "what the scene says").expect("the file loads")
}

fn at(z_m: f64) -> Input {
    let pose = Pose::new(DVec3::new(0.001, 0.002, z_m), orientation_from_rotation_vector(DVec3::Z));
    Input { time_ns: 5_000_000, dt_ns: 5_000_000, ..Input::at_rest(pose) }
}

#[test]
fn contacts_and_fields_arrive_as_the_function_gave_them() {
    let source = "
def create(argument):
    global said
    said = argument

def contacts(handle):
    assert said == 'what the scene says'
    assert abs(handle.time_s - 0.005) < 1e-12 and abs(handle.dt_s - 0.005) < 1e-12
    floor = Contact((0, 0, 1), handle.position_m[2], handle.values[0], 3, friction=0.5)
    arm = Contact((1, 0, 0), 0.25, 7, tool_point_m=(1, 0, 0), surface_velocity_m_per_s=(4, 5, 6))
    field = Field((1, 2, 3), stiffness=[[10 * row + column for column in range(6)] for row in range(6)])
    return Answer((floor, arm), field, valid_m=0.01, valid_s=0.02)
";
    let Some(path) = file("whole", source) else { return };
    let mut interpreter = started(&path);
    let input = at(-0.003);
    let set = interpreter.contacts(&input, &[800.0, 0.0, 0.0, 0.0]).expect("an answer");
    let [floor, arm] = set.contacts() else { panic!("{} contacts", set.count) };
    assert_eq!((floor.gap_m, floor.stiffness_n_per_m, floor.damping_ns_per_m), (-0.003, 800.0, 3.0));
    assert_eq!(
        (floor.friction, floor.tangential_stiffness_n_per_m),
        (0.5, 800.0),
        "across as along the normal"
    );
    assert_eq!(floor.surface_point_m, [0.001, 0.002, 0.0], "on the floor below the handle");
    assert_eq!(arm.surface_velocity_m_per_s, [4.0, 5.0, 6.0]);
    // The arm is turned by 1 rad about z, and the surface is 0.25 m from its end.
    let end_m = [0.001 + 1.0_f64.cos() - 0.25, 0.002 + 1.0_f64.sin(), -0.003];
    for (axis, metre) in end_m.iter().enumerate() {
        assert!((arm.surface_point_m[axis] - metre).abs() < 1.0e-12, "axis {axis}");
    }
    assert_eq!((set.valid_m, set.valid_s, set.time_ns, set.anchor), (0.01, 0.02, 5_000_000, input.pose));
    assert_eq!((set.field.wrench.force_n, set.field.stiffness[5][4]), ([1.0, 2.0, 3.0], 54.0));
}

#[test]
fn a_function_may_answer_one_contact_a_list_a_field_or_nothing() {
    let source = "
def contacts(handle):
    z = handle.position_m[2]
    plane = Contact((0, 0, 1), z, 100)
    return {1: plane, 2: [plane] * 20, 3: Field((0, 0, 1)), 4: None}[round(z)]
";
    let Some(path) = file("kinds", source) else { return };
    let mut interpreter = started(&path);
    let mut counts = |z_m| {
        let set = interpreter.contacts(&at(z_m), &NONE).expect("an answer");
        (set.count, set.has_field)
    };
    assert_eq!([1.0, 2.0, 3.0, 4.0].map(&mut counts), [(1, 0), (16, 0), (0, 1), (0, 0)]);
}

#[test]
fn what_a_file_prints_is_no_answer() {
    let source = "
import sys, os
print('at the start')
def contacts(handle):
    print('in a call', flush=True)
    os.write(1, b'raw')
    return Contact((0, 0, 1), 1, sys.stdin.read().count('x') + 1)
";
    let Some(path) = file("prints", source) else { return };
    let set = started(&path).contacts(&at(0.0), &NONE).expect("an answer");
    assert_eq!(set.contacts()[0].stiffness_n_per_m, 1.0);
}

#[test]
fn an_exception_has_its_message_and_ends_nothing_but_the_answer() {
    let source = "
def reset():
    global count
    count = 0
reset()
def contacts(handle):
    global count
    count += 1
    return Contact((0, 0, 1), 1 / (count - 2), count)
";
    let Some(path) = file("raises", source) else { return };
    let mut interpreter = started(&path);
    let stiffness = |interpreter: &mut Interpreter| {
        interpreter.contacts(&at(0.0), &NONE).map(|set| set.contacts()[0].stiffness_n_per_m)
    };
    assert_eq!(stiffness(&mut interpreter).expect("the first answer"), 1.0);
    let error = stiffness(&mut interpreter).expect_err("it divides by zero");
    assert_eq!(error.to_string(), "ZeroDivisionError: division by zero");
    assert_eq!(stiffness(&mut interpreter).expect("the third answer"), 3.0);
    interpreter.reset().expect("it resets");
    assert_eq!(stiffness(&mut interpreter).expect("the first answer again"), 1.0);
}

#[test]
fn a_file_that_does_not_load_says_why() {
    for (name, source, words) in [
        ("syntax", "def contacts(handle) return 1", "SyntaxError"),
        ("import", "import no_such_module_of_this_name", "No module named"),
        ("without", "x = 1", "no function `contacts(handle)`"),
        ("exits", "raise SystemExit('not today')", "not today"),
        (
            "refuses",
            "def create(argument): raise ValueError(argument)\ndef contacts(handle): pass",
            "what the scene says",
        ),
    ] {
        let Some(path) = file(name, source) else { return };
        let refused = Interpreter::start(&path, "what the scene says").err().expect("it does not load");
        assert!(refused.contains(words) && refused.contains(".py"), "{refused}");
    }
}

#[test]
fn a_process_that_is_killed_or_hangs_is_an_error_in_time() {
    let source = "
import os, time
def contacts(handle):
    if handle.position_m[2] > 0:
        os.kill(os.getpid(), 9)
    time.sleep(60)
";
    let Some(path) = file("ends", source) else { return };
    for z_m in [1.0, -1.0] {
        let mut interpreter = started(&path);
        let since = Instant::now();
        assert!(interpreter.contacts(&at(z_m), &NONE).is_err());
        assert!(since.elapsed() < Duration::from_secs(5), "it waits for longer than its timeout");
        let process = interpreter.process();
        drop(interpreter);
        assert!(!PathBuf::from(format!("/proc/{process}")).exists(), "the process is left behind");
    }
}

/// The shell is the interpreter's host, and is gone as soon as it has started it.
#[test]
fn an_interpreter_that_hangs_ends_with_its_host() {
    let Some(path) = file("endless", "while True: pass\n") else { return };
    let runner = include_str!("../src/runner.py");
    let mut shell = std::process::Command::new("sh");
    shell.args(["-c", "\"$@\" >/dev/null 2>&1 & echo $!; sleep 1", "sh", "python3", "-c", runner]);
    let output = shell.arg(&path).arg("").output().expect("a shell");
    let number = String::from_utf8_lossy(&output.stdout).trim().to_owned();
    let process = PathBuf::from("/proc").join(number).join("stat");
    let since = Instant::now();
    while process.exists() {
        assert!(since.elapsed() < Duration::from_secs(20), "the interpreter runs without a host");
        std::thread::sleep(Duration::from_millis(50));
    }
}
