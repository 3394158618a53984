//! Outputs of models that a run needs: outputs that reach the hand, and outputs that observers request.
#![deny(clippy::disallowed_types, clippy::disallowed_methods, clippy::disallowed_macros)] // see clippy.toml
#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

use crate::limits::Bound;
use flotor_hal::Demand;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Returns the outputs that reach the hand at a device: force, and torque if its bound allows any.
pub fn hand_demand(torque_nm: &Bound) -> Demand {
    if torque_nm.longest() > 0.0 { Demand::WRENCH } else { Demand::FORCE }
}

/// Outputs that the models of a device compute in one tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TickDemand {
    at_hand: Demand,
    computed: Demand,
}

impl TickDemand {
    /// Creates the demand from the outputs that reach the hand and the outputs that only observers request. Real-time:
    /// bounded, no allocation.
    #[inline]
    #[must_use]
    pub const fn new(at_hand: Demand, observed: Demand) -> Self {
        Self { at_hand, computed: at_hand.with(observed) }
    }

    /// Returns the outputs that reach the hand.
    #[inline]
    pub const fn at_hand(self) -> Demand {
        self.at_hand
    }

    /// Returns the outputs that the models compute, for the hand or an observer.
    #[inline]
    pub const fn computed(self) -> Demand {
        self.computed
    }
}

/// Counted outputs, each with the increment of one request in the word of counts.
const COUNTS: [(Demand, u64); 2] = [(Demand::TORQUE, 1), (Demand::ENERGY, 1 << 32)];

/// Outputs that observers of a run request: the number of requests for each output, in one word that the loop reads
/// every tick.
///
/// Clones share their requests. Force is always computed and not counted.
#[derive(Clone, Debug, Default)]
pub struct ObserverDemand {
    counts: Arc<AtomicU64>,
}

impl ObserverDemand {
    /// Requests outputs until the returned request is dropped; the loop computes them from its next tick on.
    pub fn request(&self, outputs: Demand) -> DemandRequest {
        let counted = counted(outputs);
        // Nothing else is published with the counts.
        self.counts.fetch_add(counted, Ordering::Relaxed);
        DemandRequest { demand: self.clone(), counted }
    }

    /// Returns the demand of all observers: force, and each output with at least one request. Real-time: bounded, no
    /// allocation.
    #[inline]
    pub fn now(&self) -> Demand {
        let counts = self.counts.load(Ordering::Relaxed);
        let [torque, energy] = COUNTS;
        let mut demand = Demand::FORCE;
        if counts & u64::from(u32::MAX) != 0 {
            demand = demand.with(torque.0);
        }
        if counts >= energy.1 {
            demand = demand.with(energy.0);
        }
        demand
    }
}

/// Request of one observer; dropping it withdraws the request.
#[derive(Debug)]
#[must_use = "a request is withdrawn when it is dropped"]
pub struct DemandRequest {
    demand: ObserverDemand,
    counted: u64,
}

impl DemandRequest {
    /// Replaces the requested outputs.
    pub fn change_to(&mut self, outputs: Demand) {
        if self.counted != counted(outputs) {
            // The new request first: outputs of both requests stay demanded throughout.
            *self = self.demand.request(outputs);
        }
    }
}

/// Returns the increment of the counts for one request of these outputs.
fn counted(outputs: Demand) -> u64 {
    COUNTS.iter().filter(|(output, _)| outputs.contains(*output)).map(|(_, one)| one).sum()
}

impl Drop for DemandRequest {
    fn drop(&mut self) {
        self.demand.counts.fetch_sub(self.counted, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_output_is_demanded_while_one_request_for_it_is_left() {
        let demand = ObserverDemand::default();
        assert_eq!(demand.now(), Demand::FORCE);
        let all = demand.request(Demand::ALL);
        let torque = demand.clone().request(Demand::TORQUE);
        let nothing = demand.request(Demand::FORCE);
        assert_eq!(demand.now(), Demand::ALL);
        drop(all);
        assert_eq!(demand.now(), Demand::WRENCH);
        let mut energy = demand.request(Demand::WRENCH);
        energy.change_to(Demand::ENERGY);
        drop(torque);
        assert_eq!(demand.now(), Demand::FORCE.with(Demand::ENERGY));
        drop((energy, nothing));
        assert_eq!(demand.now(), Demand::FORCE);
    }

    #[test]
    fn torque_is_felt_where_device_and_scene_allow_any() {
        let device = Bound::box_of([0.0, 0.0, 0.1]);
        assert_eq!(hand_demand(&Bound::box_of([0.0; 3])), Demand::FORCE);
        assert_eq!(hand_demand(&device), Demand::WRENCH);
        assert_eq!(hand_demand(&device.and(Bound::ball(0.0))), Demand::FORCE);
        assert_eq!(hand_demand(&device.and(Bound::box_of([0.5, 0.5, 0.0]))), Demand::FORCE);
    }
}
