//! Bytes of a question to the interpreter and of its answer: little-endian doubles with a header, described in `runner.py` too.

use flotor_hal::{Contact, ContactSet, DVec3, Input, LinearField, MAX_CONTACTS, Wrench};
use std::io::{self, Read};

/// Number of live values that a model gets beside the handle.
pub const VALUES: usize = 4;
/// Doubles of a question: kind, pose (7), twist (6), time (s), time step (s), values.
const QUESTION: usize = 1 + 7 + 6 + 2 + VALUES;
/// Doubles of a contact in an answer.
const CONTACT: usize = 17;
/// Doubles of a field in an answer: wrench (6) and stiffness (36).
const FIELD: usize = 6 + 36;
/// Longest message of an exception, bytes.
const LONGEST_TEXT: usize = 64 * 1024;

/// Kind of a question.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Contacts and field at a handle.
    Contacts,
    /// Reset of the history; the answer has no contacts.
    Reset,
}

/// Answer of the interpreter, or the message of its exception.
pub type Answer = Result<Box<ContactSet>, String>;

/// Returns the bytes of a question.
#[must_use]
pub fn question(kind: Kind, input: &Input, values: &[f64; VALUES]) -> Vec<u8> {
    let kind = if kind == Kind::Contacts { 0.0 } else { 1.0 };
    let times_s = [input.time_ns as f64 * 1.0e-9, input.dt_ns as f64 * 1.0e-9];
    let Input { pose, twist, .. } = input;
    let numbers = [kind].into_iter().chain(pose.position_m).chain(pose.orientation_xyzw);
    let numbers = numbers.chain(twist.linear_m_per_s).chain(twist.angular_rad_per_s);
    numbers.chain(times_s).chain(*values).flat_map(f64::to_le_bytes).collect()
}

/// Length of a question, bytes.
pub const QUESTION_BYTES: usize = QUESTION * 8;

/// Reads an answer, whose anchor and time are those of [`ContactSet::NONE`]: see [`anchored`].
///
/// # Errors
/// If the stream ends, or has no answer.
pub fn read_answer(stream: &mut impl Read) -> io::Result<Answer> {
    let mut header = [0.0; 5];
    read_doubles(stream, &mut header)?;
    let [count, has_field, valid_m, valid_rad, valid_s] = header;
    if count < 0.0 {
        return read_text(stream, has_field).map(Err);
    }
    if !(count <= MAX_CONTACTS as f64 && count.fract() == 0.0) {
        return Err(malformed());
    }
    let mut set = Box::new(ContactSet { valid_m, valid_rad, valid_s, ..ContactSet::NONE });
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // checked above
    let count = count as usize;
    for _ in 0..count {
        let mut numbers = [0.0; CONTACT];
        read_doubles(stream, &mut numbers)?;
        *set = set.with(contact(&numbers));
    }
    if has_field != 0.0 {
        let mut numbers = [0.0; FIELD];
        read_doubles(stream, &mut numbers)?;
        *set = set.with_field(field(&numbers, [valid_m, valid_rad]));
    }
    Ok(Ok(set))
}

fn contact(numbers: &[f64; CONTACT]) -> Contact {
    let [tx, ty, tz, sx, sy, sz, nx, ny, nz, gap_m, vx, vy, vz, stiffness, tangential, damping, friction] =
        *numbers;
    Contact {
        tool_point_m: [tx, ty, tz],
        surface_point_m: [sx, sy, sz],
        normal: [nx, ny, nz],
        gap_m,
        surface_velocity_m_per_s: [vx, vy, vz],
        stiffness_n_per_m: stiffness,
        tangential_stiffness_n_per_m: tangential,
        damping_ns_per_m: damping,
        friction,
    }
}

fn field(numbers: &[f64; FIELD], [valid_m, valid_rad]: [f64; 2]) -> LinearField {
    let [fx, fy, fz, tx, ty, tz, rows @ ..] = numbers;
    let mut stiffness = [[0.0; 6]; 6];
    stiffness.as_flattened_mut().copy_from_slice(rows);
    LinearField {
        wrench: Wrench::new(DVec3::new(*fx, *fy, *fz), DVec3::new(*tx, *ty, *tz)),
        stiffness,
        valid_m,
        valid_rad,
        ..LinearField::NONE
    }
}

/// Returns an answer with the pose and time of its question.
#[must_use]
pub fn anchored(mut set: Box<ContactSet>, input: &Input) -> Box<ContactSet> {
    (set.anchor, set.time_ns) = (input.pose, input.time_ns);
    (set.field.anchor, set.field.time_ns) = (input.pose, input.time_ns);
    set
}

/// Reads the UTF-8 text of an exception.
fn read_text(stream: &mut impl Read, length: f64) -> io::Result<String> {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates, and is limited
    let mut text = vec![0; (length as usize).min(LONGEST_TEXT)];
    stream.read_exact(&mut text)?;
    Ok(String::from_utf8_lossy(&text).into_owned())
}

fn read_doubles(stream: &mut impl Read, numbers: &mut [f64]) -> io::Result<()> {
    let mut bytes = [0; 8 * FIELD];
    let bytes = bytes.get_mut(..8 * numbers.len()).ok_or_else(malformed)?;
    stream.read_exact(bytes)?;
    let (each, _) = bytes.as_chunks::<8>();
    numbers.iter_mut().zip(each).for_each(|(number, bytes)| *number = f64::from_le_bytes(*bytes));
    Ok(())
}

fn malformed() -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, "the interpreter has sent malformed data")
}

/// Returns the built-in floor: a plane at z = 0, wherever the handle is.
#[must_use]
pub fn floor(input: &Input, stiffness_n_per_m: f64) -> ContactSet {
    let height_m = input.pose.position().z;
    if !input.pose.is_finite() {
        return ContactSet::NONE;
    }
    ContactSet::at(input)
        .with(Contact::of_handle(input, DVec3::Z, height_m, stiffness_n_per_m).with_damping(1.0))
}
