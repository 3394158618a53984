//! Pointer as the hand: draggable handles, and the requests of a drag.

use super::Viewer;
use crate::palette::Palette;
use crate::scene::handle_m;
use crate::ui::handle::{Handle, handle};
use egui::{Rect, Ui};
use flotor_drawing::geometry::MM_PER_M;
use flotor_history::Sample;
use flotor_history::player::Motion;
use flotor_live::ChangeMessage;
use std::time::{Duration, Instant};

/// Repaint interval while the pointer guides a hand.
const HOLDING: Duration = Duration::from_millis(50);

impl Viewer {
    /// Shows the draggable handles of the newest samples over the 3D view, and sends the requests of a drag.
    pub(super) fn handles(&mut self, ui: &Ui, area: Rect, samples: &[Sample], palette: &Palette) {
        for (device, sample) in samples.iter().enumerate() {
            if !self.can_drag(device) {
                continue;
            }
            let shape = self.shapes.iter().find(|shape| shape.device() == device);
            let handle_mm = (handle_m(shape, sample) + self.facts.placing.place_m(device)) * MM_PER_M;
            let at = Handle {
                device,
                position_m: sample.pose.position(),
                scene_mm: handle_mm,
                force_n: sample.force_n().length(),
            };
            let camera = self.view.camera;
            let guided = (&mut self.guide, &mut self.drag);
            handle(
                ui,
                (area, &camera),
                &at,
                guided,
                |way_m| shape.map_or(way_m, |shape| shape.mapping().vector_to_device(way_m)),
                palette,
            );
        }
        let request = match self.drag {
            Some(_) => self.guide.due(Instant::now()),
            None => self.guide.release(),
        };
        if self.guide.held().is_some() {
            ui.ctx().request_repaint_after(HOLDING);
        }
        if let Some(request) = request {
            self.ask(request);
        }
    }

    /// Returns whether the handle of a device can be dragged: its hand can be guided, and the newest sample of a session is shown.
    fn can_drag(&self, device: usize) -> bool {
        self.source.is_running() && self.player.motion == Motion::Follow && self.guide.has_hand(device)
    }

    /// Returns whether the hint for dragging is shown: a handle can be dragged, and no handle is dragged now.
    pub(super) fn wants_drag_hint(&self) -> bool {
        self.drag.is_none() && (0..self.devices.count()).any(|device| self.can_drag(device))
    }

    /// Processes a change of the hand, and warns if another client guides it.
    pub(super) fn take_in_guide(&mut self, change: &ChangeMessage) {
        if self.guide.apply(change) {
            self.say("Another window guides this hand; wait until it has released the handle");
        }
    }
}
