//! Guidance of a simulated hand: devices with a hand, the target, and the requests.
//!
//! The device declares four live parameters: the number of the guiding client, and the target. It releases the hand when the
//! client has been silent for a second, so an unchanged target is repeated.

use flotor_core::guidance::{GUIDE, TARGET_MM, is_guidance};
use flotor_hal::DVec3;
use flotor_live::{Ask, ChangeMessage, Outcome, PanelPlugin, SetValue};
use std::hash::{BuildHasher, Hasher, RandomState};
use std::time::{Duration, Instant};

/// Largest coordinate of a target, mm.
const FARTHEST_MM: f64 = 50.0;
/// Repetition interval of an unchanged target.
const REPEATED_AFTER: Duration = Duration::from_millis(200);

/// Hands of a run that this client may guide, and the guided hand.
#[derive(Clone, Debug)]
pub struct Guide {
    number: u32,
    /// Names of the devices in the scene's order; `None` for a device without a hand.
    hands: Vec<Option<String>>,
    held: Option<Held>,
}

#[derive(Clone, Debug)]
struct Held {
    device: usize,
    target_mm: DVec3,
    sent: Option<(DVec3, Instant)>,
}

impl Guide {
    /// Finds the hands among the plugins of a running host, which must have the devices first, in the scene's order. For a
    /// recording, `plugins` is empty.
    #[must_use]
    pub fn new(plugins: &[PanelPlugin]) -> Self {
        let hand = |plugin: &PanelPlugin| has_hand(plugin).then(|| plugin.name.clone());
        // Random, so that two clients have the same number with a probability of 2^-32.
        let random = RandomState::new().build_hasher().finish().to_le_bytes();
        let number = u32::from_le_bytes([random[0], random[1], random[2], random[3]]).max(1);
        Self { number, hands: plugins.iter().map(hand).collect(), held: None }
    }

    /// Returns whether the hand of a device can be guided.
    #[must_use]
    pub fn has_hand(&self, device: usize) -> bool {
        self.hands.get(device).is_some_and(Option::is_some)
    }

    /// Returns the number of the device with the guided hand; `None` if no hand is guided.
    #[must_use]
    pub fn held(&self) -> Option<usize> {
        self.held.as_ref().map(|held| held.device)
    }

    /// Starts to guide the hand of a device, with the position of its handle, m, as the target; guides no hand if the device has
    /// none.
    pub fn take(&mut self, device: usize, handle_m: DVec3) {
        self.held = self.has_hand(device).then(|| Held { device, target_mm: handle_m * 1.0e3, sent: None });
    }

    /// Moves the target by a vector, m; each coordinate is limited to 50 mm from home.
    pub fn move_by(&mut self, by_m: DVec3) {
        if let Some(held) = &mut self.held {
            let target_mm = held.target_mm + by_m * 1.0e3;
            held.target_mm = target_mm.clamp(DVec3::splat(-FARTHEST_MM), DVec3::splat(FARTHEST_MM));
        }
    }

    /// Releases the hand and returns the request; `None` if no hand was held.
    pub fn release(&mut self) -> Option<Ask> {
        let device = self.held.take()?.device;
        Some(Ask::Set { values: vec![self.value(device, GUIDE, "0".to_owned())] })
    }

    /// Returns the request that is due at a time: the client's number with the changed coordinates of the target, or only the
    /// client's number to keep an unchanged target; `None` if no request is due.
    pub fn due(&mut self, now: Instant) -> Option<Ask> {
        let held = self.held.as_mut()?;
        let (device, target_mm, sent) = (held.device, held.target_mm, held.sent);
        let is_new = |axis: usize| sent.is_none_or(|(sent_mm, _)| sent_mm[axis] != target_mm[axis]);
        let moved: Vec<usize> = (0..TARGET_MM.len()).filter(|axis| is_new(*axis)).collect();
        let is_old = sent.is_none_or(|(_, at)| now.duration_since(at) >= REPEATED_AFTER);
        if moved.is_empty() && !is_old {
            return None;
        }
        held.sent = Some((target_mm, now));
        let mut values = vec![self.value(device, GUIDE, self.number.to_string())];
        values.extend(
            moved.iter().map(|axis| self.value(device, TARGET_MM[*axis], format!("{:.5}", target_mm[*axis]))),
        );
        Some(Ask::Set { values })
    }

    /// Processes a change; if the device refused this client because another client guides the hand, releases the hand and returns
    /// true.
    pub fn apply(&mut self, change: &ChangeMessage) -> bool {
        let is_ours = change.parameter == GUIDE && change.number == f64::from(self.number);
        let is_refused = is_ours && change.outcome != Outcome::Applied && self.held.is_some();
        if is_refused {
            self.held = None;
        }
        is_refused
    }

    fn value(&self, device: usize, parameter: &str, value: String) -> SetValue {
        let plugin = self.hands.get(device).cloned().flatten().unwrap_or_default();
        SetValue { plugin, parameter: parameter.to_owned(), value }
    }
}

/// Returns whether a plugin is a simulated device with a hand that a client may guide. A real device, which could push a person, is
/// excluded.
fn has_hand(plugin: &PanelPlugin) -> bool {
    let has = |id: &str| plugin.parameters.iter().any(|parameter| parameter.live && parameter.id == id);
    plugin.is_simulated && has(GUIDE) && TARGET_MM.iter().all(|id| has(id))
}

/// Returns true if a parameter of a plugin guides its hand; panels omit such parameters.
#[must_use]
pub fn is_for_guides(plugin: &PanelPlugin, parameter: &str) -> bool {
    plugin.is_simulated && is_guidance(parameter)
}

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_live::{PanelParameter, ParameterShape, Subject};

    fn device(is_simulated: bool, live: bool) -> PanelPlugin {
        let parameter = |id: &str| PanelParameter {
            id: id.to_owned(),
            unit: "mm".to_owned(),
            doc: String::new(),
            shape: ParameterShape::Real { min: -50.0, max: 50.0, default: 0.0 },
            live,
            value: "0".to_owned(),
            first: "0".to_owned(),
            soft: None,
        };
        PanelPlugin {
            name: "device".to_owned(),
            id: "simulated".to_owned(),
            file: "".into(),
            is_simulated,
            parameters: [GUIDE].iter().chain(&TARGET_MM).map(|id| parameter(id)).collect(),
        }
    }

    fn sent(ask: Option<Ask>) -> Vec<(String, String)> {
        let Some(Ask::Set { values }) = ask else { return Vec::new() };
        assert!(values.iter().all(|value| value.plugin == "device"));
        values.into_iter().map(|value| (value.parameter, value.value)).collect()
    }

    #[test]
    fn only_a_simulated_device_with_live_parameters_has_a_hand() {
        for (is_simulated, live) in [(true, true), (false, true), (true, false)] {
            let mut guide = Guide::new(&[device(is_simulated, live)]);
            assert_eq!(guide.has_hand(0), is_simulated && live);
            guide.take(0, DVec3::ZERO);
            assert_eq!(guide.held().is_some(), is_simulated && live);
        }
        assert!(!Guide::new(&[]).has_hand(0));
    }

    #[test]
    fn a_target_is_sent_when_it_moves_and_repeated_while_it_stays() {
        let mut guide = Guide::new(&[device(true, true)]);
        let (start, number) = (Instant::now(), guide.number.to_string());
        assert_eq!(guide.due(start), None);
        guide.take(0, DVec3::new(0.0, 0.001, -0.002));
        let first = sent(guide.due(start));
        assert_eq!(first[0], (GUIDE.to_owned(), number.clone()));
        assert_eq!(first[3], (TARGET_MM[2].to_owned(), "-2.00000".to_owned()));
        guide.move_by(DVec3::new(0.0, 0.0, -0.0005));
        let next = sent(guide.due(start));
        assert_eq!(
            next,
            [(GUIDE.to_owned(), number.clone()), (TARGET_MM[2].to_owned(), "-2.50000".to_owned())]
        );
        assert_eq!(guide.due(start + REPEATED_AFTER / 2), None);
        assert_eq!(sent(guide.due(start + REPEATED_AFTER)), [(GUIDE.to_owned(), number)]);
        guide.move_by(DVec3::Z * 1.0e3);
        assert_eq!(sent(guide.due(start))[1].1, "50.00000");
        assert_eq!(sent(guide.release()), [(GUIDE.to_owned(), "0".to_owned())]);
        assert_eq!((guide.release(), guide.due(start)), (None, None));
    }

    #[test]
    fn a_hand_that_another_client_guides_is_not_held() {
        let mut guide = Guide::new(&[device(true, true)]);
        guide.take(0, DVec3::ZERO);
        let refused = |number: f64| ChangeMessage {
            tick: 1,
            time_ns: 1,
            plugin: "device".to_owned(),
            subject: Subject::Parameter,
            parameter: GUIDE.to_owned(),
            value: number.to_string(),
            number,
            outcome: Outcome::Refused,
            settings: Vec::new(),
        };
        assert!(!guide.apply(&refused(f64::from(guide.number) + 1.0)), "another client was refused");
        assert!(guide.apply(&refused(f64::from(guide.number))));
        assert_eq!(guide.held(), None);
    }
}
