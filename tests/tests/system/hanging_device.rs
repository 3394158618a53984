//! A stop takes the force away while `read` of a device in the short form hangs: zero is on the wire before the read returns.

use fixture_hanging_device::{FRAME_BYTES, HANG, monotonic_ns};
use flotor_tests::library::plugin_file;
use flotor_tests::program::{Flotor, exit_code};
use flotor_tests::scratch::Scratch;
use rustix::fs::{CWD, FileType, Mode, mknodat};
use serialport::{SerialPort as _, TTYPort};
use std::fs::File;
use std::io::Read;
use std::net::TcpListener;
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

/// One frame at the other end of the wire.
#[derive(Clone, Copy, Debug)]
struct Frame {
    force_n: f64,
    /// Time of the call that sent the frame, ns.
    called_ns: u64,
    /// Time of the arrival, ns.
    arrived_ns: u64,
}

/// Reads frames in a thread until the other end is closed; `kept` stays open meanwhile.
fn frames_of(mut wire: impl Read + Send + 'static, kept: impl Send + 'static) -> Receiver<Frame> {
    let (sender, receiver) = channel();
    std::thread::spawn(move || {
        let (_kept, mut frame) = (kept, [0; FRAME_BYTES]);
        while wire.read_exact(&mut frame).is_ok() {
            let arrived_ns = monotonic_ns();
            let (force, called) = frame.split_at(8);
            let force_n = f64::from_le_bytes(force.try_into().expect("eight bytes"));
            let called_ns = u64::from_le_bytes(called.try_into().expect("eight bytes"));
            if sender.send(Frame { force_n, called_ns, arrived_ns }).is_err() {
                return;
            }
        }
    });
    receiver
}

/// Validates the device on a wire; expects zero force at the other end before the read returns.
fn stopped_in_time(transport: &str, address: &str, frames: &Receiver<Frame>) {
    let library = plugin_file("fixture-hanging-device").display().to_string();
    let [transport_is, address_is] = [format!("transport={transport}"), format!("address={address}")];
    let validate = ["validate", &library, "--timeout", "60s", "--set", &transport_is, "--set", &address_is];
    let ran = Flotor::with(validate).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:#?}");
    let frames: Vec<Frame> =
        std::iter::from_fn(|| frames.recv_timeout(Duration::from_millis(500)).ok()).collect();
    let returned = frames.iter().position(|frame| frame.force_n.is_nan()).expect("the read hung");
    let stop = frames[..returned].iter().rposition(|frame| frame.force_n == 0.0).expect("a stop in the hang");
    assert!(
        stop > 0 && frames[stop - 1].force_n > 0.0,
        "the stop was of another run: {:?}",
        &frames[..returned]
    );
    let hung_for_ns = frames[returned].called_ns - frames[stop - 1].called_ns;
    assert!(u128::from(hung_for_ns) >= HANG.as_nanos(), "{hung_for_ns} ns");
    let took_ns = frames[stop].arrived_ns - frames[stop].called_ns;
    println!(
        "{transport}: zero force {:.3} ms after the call of the stop, in a read of 1 s",
        took_ns as f64 * 1.0e-6
    );
    // After the stop nothing but zero until the next activation.
    let later = frames[returned + 1..].iter().find(|frame| frame.force_n != 0.0);
    assert!(later.is_none(), "{later:?}");
}

#[test]
fn a_device_on_a_serial_port_is_stopped_while_its_read_hangs() {
    let (mut ours, theirs) = TTYPort::pair().expect("the system has pseudo terminals");
    let path = theirs.name().expect("it has a name");
    ours.set_timeout(Duration::from_secs(120)).expect("a timeout");
    // The descriptor of the device's end keeps the port open between two instances.
    let frames = frames_of(ours, theirs);
    stopped_in_time("serial", &path, &frames);
}

#[test]
fn a_device_at_a_hid_path_is_stopped_while_its_read_hangs() {
    let scratch = Scratch::default();
    let path = scratch.path().join("hidraw");
    mknodat(CWD, &path, FileType::Fifo, Mode::RWXU, 0).expect("a named pipe");
    // Open for reading and writing: a pipe without a writer would end.
    let pipe = File::options().read(true).write(true).open(&path).expect("a pipe");
    let frames = frames_of(pipe, ());
    stopped_in_time("hid", &path.display().to_string(), &frames);
}

#[test]
fn a_device_on_tcp_is_stopped_while_its_read_hangs() {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let address = listener.local_addr().expect("it has one").to_string();
    let (sender, frames) = channel();
    std::thread::spawn(move || {
        for connection in listener.incoming() {
            let Ok(connection) = connection else { return };
            for frame in frames_of(connection, ()) {
                if sender.send(frame).is_err() {
                    return;
                }
            }
        }
    });
    stopped_in_time("tcp", &address, &frames);
}
