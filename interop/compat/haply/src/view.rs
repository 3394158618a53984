//! View of a device by a session: axes, origin, mount and workspace. Flotor's axes are the service's own: x right, y away from the
//! user, z up.

use flotor_hal::{DQuat, DVec3};
use serde_json::{Map, Value, json};

/// Centre of the device's range for a session whose origin is the base of the device, m.
const CENTRE_M: DVec3 = DVec3::new(0.0, -0.12, 0.15);
/// Smallest invertible scale, and smallest norm of a quaternion.
const SMALLEST: f64 = 1.0e-6;

/// Permutation of the axes, each with a sign.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Basis {
    axes: [usize; 3],
    signs: [f64; 3],
}

const AXES: [char; 3] = ['X', 'Y', 'Z'];

impl Basis {
    const PLAIN: Self = Self { axes: [0, 1, 2], signs: [1.0; 3] };

    /// Parses `XZY`, `X-YZ` or `+X+Y+Z`: the session's x, y, z in terms of the device's axes; `None` for any other text.
    pub(crate) fn parse(text: &str) -> Option<Self> {
        let (mut axes, mut signs, mut length, mut sign) = ([3; 3], [1.0; 3], 0, None);
        for letter in text.chars() {
            if let ('+' | '-', None) = (letter, sign) {
                sign = Some(if letter == '-' { -1.0 } else { 1.0 });
                continue;
            }
            let axis = AXES.iter().position(|axis| *axis == letter.to_ascii_uppercase())?;
            if axes.contains(&axis) {
                return None;
            }
            *axes.get_mut(length)? = axis;
            *signs.get_mut(length)? = sign.take().unwrap_or(1.0);
            length += 1;
        }
        (length == 3 && sign.is_none()).then_some(Self { axes, signs })
    }

    pub(crate) fn name(&self) -> String {
        let letters = |(axis, sign): (usize, f64)| {
            (sign < 0.0).then_some('-').into_iter().chain(AXES.get(axis).copied())
        };
        self.axes.into_iter().zip(self.signs).flat_map(letters).collect()
    }

    fn of_device(&self, vector: DVec3) -> DVec3 {
        let device = vector.to_array();
        let part = |place: usize| self.signs[place] * device[self.axes[place]];
        DVec3::new(part(0), part(1), part(2))
    }

    fn to_device(self, vector: DVec3) -> DVec3 {
        let mut device = [0.0; 3];
        for (place, value) in vector.to_array().into_iter().enumerate() {
            device[self.axes[place]] = self.signs[place] * value;
        }
        DVec3::from_array(device)
    }

    /// Converts a rotation to these axes; if they are left-handed, the rotation axis is reversed.
    fn orientation(&self, turn: DQuat) -> DQuat {
        let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| self.of_device(axis));
        let handed = x.cross(y).dot(z);
        let axis = self.of_device(DVec3::new(turn.x, turn.y, turn.z)) * handed;
        DQuat::from_xyzw(axis.x, axis.y, axis.z, turn.w)
    }
}

/// Transform: a scale along the axes, then a rotation, then a translation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Transform {
    position_m: DVec3,
    rotation: DQuat,
    scale: DVec3,
}

impl Transform {
    pub(crate) const NONE: Self =
        Self { position_m: DVec3::ZERO, rotation: DQuat::IDENTITY, scale: DVec3::ONE };

    /// Returns this transform with the parts of a patch replaced; `None` if a part is malformed or not invertible.
    pub(crate) fn patched(&self, patch: &Value) -> Option<Self> {
        let part = |name: &str, before: DVec3| match patch.get(name) {
            None => Some(before),
            Some(value) => vector(value),
        };
        let rotation = match patch.get("rotation") {
            None => self.rotation,
            Some(value) => {
                let [w, x, y, z] = ["w", "x", "y", "z"].map(|name| value.get(name).and_then(Value::as_f64));
                let rotation = DQuat::from_xyzw(x?, y?, z?, w?);
                if rotation.length() < SMALLEST {
                    return None;
                }
                rotation.normalize()
            }
        };
        let (position_m, scale) = (part("position", self.position_m)?, part("scale", self.scale)?);
        (scale.abs().min_element() >= SMALLEST).then_some(Self { position_m, rotation, scale })
    }

    /// Encodes the transform like the service, without parts at their defaults.
    pub(crate) fn to_json(self) -> Value {
        let mut parts = Map::new();
        if self.position_m != DVec3::ZERO {
            parts.insert("position".to_owned(), of_vector(self.position_m));
        }
        if self.rotation != DQuat::IDENTITY {
            let DQuat { x, y, z, w } = self.rotation;
            parts.insert("rotation".to_owned(), json!({ "w": w, "x": x, "y": y, "z": z }));
        }
        if self.scale != DVec3::ONE {
            parts.insert("scale".to_owned(), of_vector(self.scale));
        }
        Value::Object(parts)
    }

    fn point(&self, place: DVec3) -> DVec3 {
        self.position_m + self.rotation * (self.scale * place)
    }

    fn point_back(&self, place: DVec3) -> DVec3 {
        (self.rotation.conjugate() * (place - self.position_m)) / self.scale
    }
}

/// Parses a vector of three finite numbers x, y, z.
pub(crate) fn vector(value: &Value) -> Option<DVec3> {
    numbers(value, ["x", "y", "z"])
}

/// Parses three finite numbers by their names.
pub(crate) fn numbers(value: &Value, names: [&str; 3]) -> Option<DVec3> {
    let [x, y, z] = names.map(|name| value.get(name).and_then(Value::as_f64));
    Some(DVec3::new(x?, y?, z?)).filter(|vector| vector.is_finite())
}

pub(crate) fn of_vector(vector: DVec3) -> Value {
    json!({ "x": vector.x, "y": vector.y, "z": vector.z })
}

/// Presets by name; true for an origin at the centre of the range.
pub(crate) const PRESETS: [(&str, bool); 6] = [
    ("defaults", false),
    ("arm_front", false),
    ("arm_front_centered", true),
    ("led_front", false),
    ("led_front_centered", true),
    ("custom", false),
];

/// View of a device by a session, with the session's settings.
#[derive(Clone, Debug)]
pub(crate) struct View {
    pub(crate) basis: Basis,
    pub(crate) mount: Transform,
    pub(crate) workspace: Transform,
    pub(crate) preset: &'static str,
    origin_m: DVec3,
    /// Damping added while the session commands the device, N·s/m along the device's axes.
    pub(crate) damping: DVec3,
    /// Stored gain of the force gate, without effect: its effect on a force is not known.
    pub(crate) force_gate: f64,
}

impl Default for View {
    fn default() -> Self {
        Self {
            basis: Basis::PLAIN,
            mount: Transform::NONE,
            workspace: Transform::NONE,
            preset: "defaults",
            origin_m: CENTRE_M,
            damping: DVec3::ZERO,
            force_gate: 0.3,
        }
    }
}

impl View {
    /// Selects a preset of the service, which resets mount and origin except for `custom`; returns false for an unknown name.
    pub(crate) fn set_preset(&mut self, name: &str) -> bool {
        let Some((name, is_centred)) = PRESETS.iter().find(|(preset, _)| *preset == name) else {
            return false;
        };
        self.preset = name;
        if *name != "custom" {
            self.mount = Transform::NONE;
            self.origin_m = if *is_centred { DVec3::ZERO } else { CENTRE_M };
        }
        true
    }

    /// Sets the mount, and the preset to `custom`.
    pub(crate) fn set_mount(&mut self, mount: Transform) {
        (self.mount, self.preset) = (mount, "custom");
    }

    pub(crate) fn position(&self, position_m: DVec3) -> DVec3 {
        self.workspace.point(self.mount.point(self.basis.of_device(position_m + self.origin_m)))
    }

    pub(crate) fn position_back(&self, position: DVec3) -> DVec3 {
        self.basis.to_device(self.mount.point_back(self.workspace.point_back(position))) - self.origin_m
    }

    pub(crate) fn velocity(&self, velocity_m_per_s: DVec3) -> DVec3 {
        let mounted = self.mount.rotation * (self.mount.scale * self.basis.of_device(velocity_m_per_s));
        self.workspace.rotation * (self.workspace.scale * mounted)
    }

    /// Rotates a force, N, to the session's axes, without scale.
    pub(crate) fn force(&self, force_n: DVec3) -> DVec3 {
        self.workspace.rotation * (self.mount.rotation * self.basis.of_device(force_n))
    }

    pub(crate) fn force_back(&self, force_n: DVec3) -> DVec3 {
        let mounted = self.workspace.rotation.conjugate() * force_n;
        self.basis.to_device(self.mount.rotation.conjugate() * mounted)
    }

    pub(crate) fn orientation(&self, orientation: DQuat) -> DQuat {
        self.workspace.rotation * self.mount.rotation * self.basis.orientation(orientation)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_basis_names_the_device_axis_of_each_of_its_own() {
        let device = DVec3::new(1.0, 2.0, 3.0);
        for (text, own) in [
            ("XYZ", [1.0, 2.0, 3.0]),
            ("YZX", [2.0, 3.0, 1.0]),
            ("X-YZ", [1.0, -2.0, 3.0]),
            ("+xz-y", [1.0, 3.0, -2.0]),
        ] {
            let basis = Basis::parse(text).expect(text);
            assert_eq!(basis.of_device(device).to_array(), own, "{text}");
            assert_eq!(basis.to_device(basis.of_device(device)), device, "{text}");
            assert_eq!(Basis::parse(&basis.name()), Some(basis), "{text}");
        }
        for wrong in ["", "XY", "XXY", "XYZX", "XY-", "X--YZ", "ABC"] {
            assert_eq!(Basis::parse(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn an_orientation_turns_vectors_of_a_basis_as_it_turns_those_of_the_device() {
        let turn = DQuat::from_rotation_x(0.3) * DQuat::from_rotation_z(-0.7);
        let vector = DVec3::new(0.2, -0.5, 0.9);
        for text in ["XYZ", "XZY", "X-YZ", "ZXY", "-X-Y-Z"] {
            let basis = Basis::parse(text).expect(text);
            let turned = basis.orientation(turn) * basis.of_device(vector);
            assert!((turned - basis.of_device(turn * vector)).length() < 1.0e-15, "{text}");
        }
    }

    #[test]
    fn places_come_back_through_basis_mount_and_workspace_and_forces_keep_their_length() {
        let mut view = View { basis: Basis::parse("XZY").expect("it is one"), ..View::default() };
        let mount = json!({ "position": { "x": 0.1, "y": 0.0, "z": -0.2 }, "rotation": { "w": 2.0, "x": 0.0, "y": 1.0, "z": 0.0 },
            "scale": { "x": 2.0, "y": 3.0, "z": -1.0 } });
        view.set_mount(Transform::NONE.patched(&mount).expect("it can be undone"));
        view.workspace = Transform::NONE
            .patched(&json!({ "scale": { "x": 5.0, "y": 5.0, "z": 5.0 } }))
            .expect("it can be undone");
        let (place, force) = (DVec3::new(0.01, -0.02, 0.005), DVec3::new(1.0, 2.0, -2.0));
        assert!((view.position_back(view.position(place)) - place).length() < 1.0e-15);
        assert!((view.force(force).length() - 3.0).abs() < 1.0e-14);
        assert!((view.force_back(view.force(force)) - force).length() < 1.0e-14);
        assert_eq!(view.preset, "custom");
        assert!(view.set_preset("arm_front_centered") && !view.set_preset("upside_down"));
        view.workspace = Transform::NONE;
        assert_eq!(view.position(DVec3::ZERO), DVec3::ZERO);
    }

    #[test]
    fn what_cannot_be_undone_is_no_transform_and_what_is_plain_is_not_told() {
        assert_eq!(Transform::NONE.to_json(), json!({}));
        for wrong in [
            json!({ "scale": { "x": 0.0, "y": 1.0, "z": 1.0 } }),
            json!({ "rotation": { "w": 0.0, "x": 0.0, "y": 0.0, "z": 0.0 } }),
            json!({ "position": { "x": 0.0 } }),
            json!({ "position": "here" }),
        ] {
            assert_eq!(Transform::NONE.patched(&wrong), None, "{wrong}");
        }
    }
}
