//! Parser of the puck's HID reports. No I/O here.
//!
//! | First byte | Then | Meaning |
//! |---|---|---|
//! | 1 | 3 × i16 | translation x, y, z |
//! | 1 | 6 × i16 | translation and rotation x, y, z (newer pucks) |
//! | 2 | 3 × i16 | rotation x, y, z |
//! | 3 | 2 to 6 bytes | buttons, one bit each |
//!
//! Numbers are little-endian. The descriptor of the SpaceNavigator (256f:c635 is its emulation in this crate's tests) gives
//! ±350 as the logical range. The axes are those of the HID usage tables (page 1, usages 30 to 35 hex): x to the
//! right, y towards the user, z down, rotations about them by the right-hand rule. Other reports (battery, keys by
//! code) are ignored.

/// Reading of an axis at the mechanical stop.
pub const FULL_DEFLECTION: i16 = 350;

/// Parsed report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Report {
    /// Translation x, y, z alone.
    Translation([i16; 3]),
    /// Rotation x, y, z alone.
    Rotation([i16; 3]),
    /// Translation and rotation in one report.
    Motion {
        /// Translation x, y, z.
        translation: [i16; 3],
        /// Rotation x, y, z.
        rotation: [i16; 3],
    },
    /// Buttons, one bit each; buttons beyond the 32nd are dropped.
    Buttons(u32),
    /// Report of another kind, or too short.
    Other,
}

impl Report {
    /// Parses a report; the first byte is its HID report id. Real-time: bounded, no allocation.
    #[must_use]
    pub fn parse(bytes: &[u8]) -> Self {
        match bytes {
            [1, a, b, c, d, e, f, u, v, w, x, y, z, ..] => Self::Motion {
                translation: three([*a, *b, *c, *d, *e, *f]),
                rotation: three([*u, *v, *w, *x, *y, *z]),
            },
            [1, a, b, c, d, e, f, ..] => Self::Translation(three([*a, *b, *c, *d, *e, *f])),
            [2, a, b, c, d, e, f, ..] => Self::Rotation(three([*a, *b, *c, *d, *e, *f])),
            [3, buttons @ ..] if !buttons.is_empty() => {
                let with = |bits: u32, (index, byte): (usize, &u8)| bits | u32::from(*byte) << (8 * index);
                Self::Buttons(buttons.iter().take(4).enumerate().fold(0, with))
            }
            _ => Self::Other,
        }
    }
}

fn three([a, b, c, d, e, f]: [u8; 6]) -> [i16; 3] {
    [[a, b], [c, d], [e, f]].map(i16::from_le_bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn reports_seen_on_the_wire() {
        assert_eq!(Report::parse(&[1, 0, 0, 0, 0, 0, 0]), Report::Translation([0; 3]));
        // Tilted about its second axis.
        assert_eq!(Report::parse(&[2, 0, 0, 0xe2, 0xff, 0, 0]), Report::Rotation([0, -30, 0]));
        assert_eq!(Report::parse(&[3, 3, 0]), Report::Buttons(3));
        assert_eq!(Report::parse(&[3, 0, 0, 0, 0x80, 9]), Report::Buttons(1 << 31));
        let both = [1, 94, 1, 0, 0, 0, 0, 0, 0, 0, 0, 162, 254];
        assert_eq!(Report::parse(&both), Report::Motion { translation: [350, 0, 0], rotation: [0, 0, -350] });
    }

    #[test]
    fn what_is_short_or_unknown_is_nothing() {
        for bytes in
            [&[][..], &[1], &[1, 0, 0, 0, 0, 0], &[2, 1, 2, 3], &[3], &[23, 100], &[0, 1, 2, 3, 4, 5, 6]]
        {
            assert_eq!(Report::parse(bytes), Report::Other, "{bytes:?}");
        }
    }

    proptest! {
        #[test]
        fn any_bytes_are_read(bytes in prop::collection::vec(any::<u8>(), 0..80)) {
            let _ = Report::parse(&bytes); // without a panic
        }

        #[test]
        fn a_report_that_is_cut_short_moves_nothing(t in any::<[i16; 3]>(), length in 1..7usize) {
            let whole: Vec<u8> = [1].into_iter().chain(t.iter().flat_map(|axis| axis.to_le_bytes())).collect();
            prop_assert_eq!(Report::parse(&whole[..length]), Report::Other);
        }

        #[test]
        fn what_is_written_is_what_is_read(t in any::<[i16; 3]>(), r in any::<[i16; 3]>()) {
            let words = |number: u8, axes: &[i16]| {
                [number].into_iter().chain(axes.iter().flat_map(|axis| axis.to_le_bytes())).collect::<Vec<u8>>()
            };
            prop_assert_eq!(Report::parse(&words(1, &t)), Report::Translation(t));
            prop_assert_eq!(Report::parse(&words(2, &r)), Report::Rotation(r));
            let both = words(1, &[t, r].concat());
            prop_assert_eq!(Report::parse(&both), Report::Motion { translation: t, rotation: r });
        }
    }
}
