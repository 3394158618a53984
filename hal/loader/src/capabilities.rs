//! Validation of the capabilities that a device declares. Not real-time.
//!
//! The safety envelope, the boundary wall and the sample check take their limits from these numbers: a missing,
//! infinite or contradictory number would leave the hand unprotected. Each refusal names the field and the remedy.

use flotor_hal::{Axes, Capabilities, Refusal};

/// Value of a capability field with its largest plausible value. Zero is allowed; a value above `most` indicates a wrong
/// unit or corrupt memory.
struct Number<T> {
    field: &'static str,
    value: T,
    most: f64,
    unit: &'static str,
}

/// Capabilities of the three translations, or of the three rotations.
struct Group {
    /// Names of the axes in errors.
    names: [&'static str; 3],
    /// Quantity in errors that `limit` bounds.
    load: &'static str,
    /// Axis masks of x, y and z.
    axes: [Axes; 3],
    range: Number<[f64; 3]>,
    limit: Number<[f64; 3]>,
    slew: Number<f64>,
}

/// Largest plausible rate, beyond any loop, Hz.
const MOST_RATE_HZ: f64 = 1.0e7;

/// Rejects capabilities that no host can enforce.
pub(super) fn check(declared: &Capabilities) -> Result<(), Refusal> {
    for (field, axes) in [("sensed", declared.sensed), ("actuated", declared.actuated)] {
        if !Axes::ALL.contains(axes) {
            let found = format!("{:#b}", axes.bits());
            return Err(wrong(field, &found, "there are six axes; clear the bits above the sixth"));
        }
    }
    let translation = Group {
        names: ["x", "y", "z"],
        load: "force",
        axes: [Axes::X, Axes::Y, Axes::Z],
        range: number("range_m", declared.range_m, 100.0, "m"),
        limit: number("max_force_n", declared.max_force_n, 1.0e5, "N"),
        slew: number("max_force_slew_n_per_s", declared.max_force_slew_n_per_s, 1.0e10, "N/s"),
    };
    let rotation = Group {
        names: ["the rotation about x", "the rotation about y", "the rotation about z"],
        load: "torque",
        axes: [Axes::RX, Axes::RY, Axes::RZ],
        range: number("range_rad", declared.range_rad, 1.0e3, "rad"),
        limit: number("max_torque_nm", declared.max_torque_nm, 1.0e5, "N·m"),
        slew: number("max_torque_slew_nm_per_s", declared.max_torque_slew_nm_per_s, 1.0e10, "N·m/s"),
    };
    translation.check(declared)?;
    rotation.check(declared)?;
    let [slowest_hz, fastest_hz] = declared.rate_hz;
    number("resolution_m", declared.resolution_m, 1.0, "m").has_an_end()?;
    number("max_stiffness_n_per_m", declared.max_stiffness_n_per_m, 1.0e10, "N/m").has_an_end()?;
    number("latency_s", declared.latency_s, 10.0, "s").has_an_end()?;
    let are_rates = slowest_hz > 0.0 && slowest_hz <= fastest_hz && fastest_hz <= MOST_RATE_HZ; // false for NaN
    if !are_rates {
        let found = format!("{slowest_hz} to {fastest_hz} Hz");
        let mend = format!(
            "declare the slowest rate first, above 0, and then the fastest, at most {MOST_RATE_HZ} Hz"
        );
        return Err(wrong("rate_hz", &found, &mend));
    }
    Ok(())
}

/// Rejects capabilities that differ from those of an earlier call: the envelope is built once.
pub(super) fn check_unchanged(before: &Capabilities, now: &Capabilities) -> Result<(), Refusal> {
    if before == now {
        return Ok(());
    }
    let numbers = |declared: &Capabilities| {
        [
            ("range_m", declared.range_m.to_vec()),
            ("range_rad", declared.range_rad.to_vec()),
            ("resolution_m", vec![declared.resolution_m]),
            ("max_force_n", declared.max_force_n.to_vec()),
            ("max_torque_nm", declared.max_torque_nm.to_vec()),
            ("max_force_slew_n_per_s", vec![declared.max_force_slew_n_per_s]),
            ("max_torque_slew_nm_per_s", vec![declared.max_torque_slew_nm_per_s]),
            ("max_stiffness_n_per_m", vec![declared.max_stiffness_n_per_m]),
            ("rate_hz", declared.rate_hz.to_vec()),
            ("latency_s", vec![declared.latency_s]),
        ]
    };
    let changed = numbers(before).into_iter().zip(numbers(now)).find(|(before, now)| before != now);
    let masks = || match before.sensed == now.sensed {
        true => format!("`actuated` was {:#b}, then {:#b}", before.actuated.bits(), now.actuated.bits()),
        false => format!("`sensed` was {:#b}, then {:#b}", before.sensed.bits(), now.sensed.bits()),
    };
    let changed = changed.map_or_else(masks, |((field, before), (_, now))| {
        format!("`{field}` was {}, then {}", list(&before), list(&now))
    });
    Err(Refusal::broken(format!(
        "the capabilities changed between two calls, but must be constant from `open` on: {changed}"
    )))
}

impl Group {
    fn check(&self, declared: &Capabilities) -> Result<(), Refusal> {
        let Self { names, load, axes, range, limit, slew } = self;
        range.has_an_end()?;
        limit.has_an_end()?;
        let driven = axes.map(|axis| declared.actuated.contains(axis));
        let held = axes.map(|axis| declared.actuated.contains(axis) && declared.sensed.contains(axis));
        limit.is_more_than_nothing_on(
            names,
            driven,
            &format!("declare its largest {load}, or remove the axis from `actuated`"),
        )?;
        // Without a range the boundary wall would stand at home.
        range.is_more_than_nothing_on(
            names,
            held,
            "declare its range of motion, or remove the axis from `actuated`",
        )?;
        if driven == [false; 3] {
            // Without an actuated axis the slew has no effect: infinity and 0 are valid.
            return if slew.value >= 0.0 {
                Ok(())
            } else {
                Err(slew.wrong(&format!("must be 0 {} or more", slew.unit)))
            };
        }
        slew.has_an_end()?;
        if slew.value == 0.0 {
            let mend = format!("the {load} could never change; declare a rate above 0 {}", slew.unit);
            return Err(slew.wrong(&mend));
        }
        Ok(())
    }
}

/// Formats numbers in scene syntax: a single number plain, several in brackets, very large ones with an exponent.
fn list(numbers: &[f64]) -> String {
    let words: Vec<String> = numbers.iter().map(|number| format!("{number:?}")).collect();
    match words.iter().map(|word| word.trim_end_matches(".0")).collect::<Vec<_>>()[..] {
        [number] => number.to_owned(),
        ref numbers => format!("[{}]", numbers.join(", ")),
    }
}

impl Number<f64> {
    fn has_an_end(&self) -> Result<(), Refusal> {
        let Self { value, most, unit, .. } = self;
        if (0.0..=*most).contains(value) {
            return Ok(()); // false for NaN
        }
        Err(self.wrong(&format!("must be 0 to {most} {unit}")))
    }

    fn wrong(&self, mend: &str) -> Refusal {
        wrong(self.field, &list(&[self.value]), mend)
    }
}

impl Number<[f64; 3]> {
    fn has_an_end(&self) -> Result<(), Refusal> {
        let Self { field, value, most, unit } = self;
        if value.iter().all(|value| (0.0..=*most).contains(value)) {
            return Ok(()); // false for NaN
        }
        Err(wrong(field, &list(value), &format!("must be 0 to {most} {unit} on each axis")))
    }

    fn is_more_than_nothing_on(&self, names: &[&str; 3], axes: [bool; 3], mend: &str) -> Result<(), Refusal> {
        let Self { field, value, .. } = self;
        let mut empty = names.iter().zip(value.iter().zip(axes));
        match empty.find(|(_, (value, is_needed))| *is_needed && **value == 0.0) {
            None => Ok(()),
            Some((name, _)) => Err(wrong(field, &list(value), &format!("{name} is driven, so {mend}"))),
        }
    }
}

const fn number<T>(field: &'static str, value: T, most: f64, unit: &'static str) -> Number<T> {
    Number { field, value, most, unit }
}

fn wrong(field: &str, found: &str, mend: &str) -> Refusal {
    Refusal::broken(format!("the capability `{field}` is {found}: {mend}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const HELD: Capabilities = Capabilities::driving(Axes::ALL)
        .with_range(0.012, 0.12)
        .with_limits(10.0, 1.0)
        .with_slew(1.0e6, 1.0e6)
        .with_stiffness(1.0e4);
    const PLANAR: Capabilities = Capabilities {
        sensed: Axes::PLANE,
        actuated: Axes::PLANE,
        range_m: [0.08, 0.05, 0.0],
        range_rad: [0.0; 3],
        max_force_n: [3.0, 3.0, 0.0],
        max_torque_nm: [0.0; 3],
        max_torque_slew_nm_per_s: 0.0,
        ..HELD
    };

    #[test]
    fn what_devices_are_like_passes() {
        let puck = Capabilities { sensed: Axes::ALL, range_m: [0.012; 3], ..Capabilities::UNDRIVEN };
        let endless = Capabilities { max_torque_slew_nm_per_s: f64::INFINITY, ..PLANAR }; // of nothing
        let silent = Capabilities { max_stiffness_n_per_m: 0.0, ..HELD }; // says nothing
        let buzzer = Capabilities { sensed: Axes::NONE, range_m: [0.0; 3], range_rad: [0.0; 3], ..HELD };
        for declared in [HELD, PLANAR, puck, endless, silent, buzzer, Capabilities::UNDRIVEN] {
            assert_eq!(check(&declared), Ok(()), "{declared:?}");
        }
    }

    #[test]
    fn every_number_has_to_be_one_that_can_be_enforced() {
        // Where each number stands, and whether it may be nothing.
        type Field = (&'static str, fn(&mut Capabilities) -> &mut f64, bool);
        let fields: [Field; 11] = [
            ("range_m", |declared| &mut declared.range_m[1], false),
            ("range_rad", |declared| &mut declared.range_rad[2], false),
            ("resolution_m", |declared| &mut declared.resolution_m, true),
            ("max_force_n", |declared| &mut declared.max_force_n[0], false),
            ("max_torque_nm", |declared| &mut declared.max_torque_nm[2], false),
            ("max_force_slew_n_per_s", |declared| &mut declared.max_force_slew_n_per_s, false),
            ("max_torque_slew_nm_per_s", |declared| &mut declared.max_torque_slew_nm_per_s, false),
            ("max_stiffness_n_per_m", |declared| &mut declared.max_stiffness_n_per_m, true),
            ("rate_hz", |declared| &mut declared.rate_hz[0], false),
            ("rate_hz", |declared| &mut declared.rate_hz[1], false),
            ("latency_s", |declared| &mut declared.latency_s, true),
        ];
        for (field, number, may_be_nothing) in fields {
            for value in [f64::NAN, f64::INFINITY, -f64::INFINITY, -1.0e-9, 1.0e308, f64::MAX, 0.0] {
                let mut declared = HELD;
                *number(&mut declared) = value;
                if value == 0.0 && may_be_nothing {
                    assert_eq!(check(&declared), Ok(()), "{field}");
                    continue;
                }
                let reason = check(&declared).expect_err(field).reason;
                assert!(reason.starts_with(&format!("the capability `{field}")), "{value}: {reason}");
                assert!(reason.contains(": ") && !reason.contains('\n'), "{reason}");
            }
        }
    }

    /// Axes as a foreign plugin may write them.
    fn axes(bits: u32) -> Axes {
        // SAFETY: `Axes` is a `repr(C)` struct of one `u32` and valid for any bits.
        unsafe { std::mem::transmute::<u32, Axes>(bits) }
    }

    #[test]
    fn what_contradicts_itself_is_refused_with_what_to_mend() {
        let cases = [
            (Capabilities { rate_hz: [1000.0, 100.0], ..HELD }, "declare the slowest rate first"),
            (Capabilities { sensed: axes(0x7f), ..HELD }, "`sensed` is 0b1111111: there are six"),
            (Capabilities { actuated: axes(u32::MAX), ..HELD }, "clear the bits above the sixth"),
            (
                Capabilities { max_torque_nm: [0.0; 3], ..HELD },
                "the rotation about x is driven, so declare its largest torque",
            ),
            (
                Capabilities { actuated: Axes::TRANSLATION, ..PLANAR },
                "z is driven, so declare its largest force",
            ),
            (Capabilities { range_m: [0.0; 3], ..HELD }, "x is driven, so declare its range of motion"),
        ];
        for (declared, words) in cases {
            let reason = check(&declared).expect_err(words).reason;
            assert!(reason.contains(words), "{reason}");
        }
    }

    #[test]
    fn what_was_told_stays() {
        assert_eq!(check_unchanged(&HELD, &HELD), Ok(()));
        let more = Capabilities { max_force_n: [20.0; 3], ..HELD };
        let reason = check_unchanged(&HELD, &more).expect_err("it changed").reason;
        assert!(reason.contains("capabilities changed") && reason.contains("[20, 20, 20]"), "{reason}");
    }
}
