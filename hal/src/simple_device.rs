//! The short form of a device: three functions, and a handle that removes the force.
//!
//! [`Device`] has one type per phase. A device with the same data in both phases is shorter as a [`SimpleDevice`], which
//! [`Simple`] converts to a [`Device`]: `export_device!(Simple<Crank>);`. The plugin contract is the same.

use crate::{
    ActiveDevice, Capabilities, Cycle, Device, DeviceInfo, DeviceState, IndependentStop,
    IndependentStopDevice, LoopConfig, Parameter, Refusal, SafeStop, SetParameterError, Settings, Tick,
    Wrench,
};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A device with the same data before and after activation.
pub trait SimpleDevice: Sized + Send + 'static {
    /// Constant description of the device.
    const INFO: DeviceInfo;
    /// Schema of the parameters.
    const PARAMETERS: &'static [Parameter] = &[];
    /// Handle that removes the force from another thread: a second descriptor, or a [`StopFlag`]. The handle borrows
    /// nothing from the device, so that a stop works while [`Self::read`] hangs.
    type Stop: SafeStop;

    /// Opens the device. The settings are already checked against the schema. May block. Not real-time.
    ///
    /// # Errors
    /// A [`Refusal`] with the remedy if the device is missing, busy, forbidden or badly configured.
    fn open(settings: &Settings<'_>) -> Result<Opened<Self>, Refusal>;

    /// Energises the device at zero wrench. Not real-time.
    ///
    /// # Errors
    /// A [`Refusal`]; the device stays open, and may be activated again.
    fn activate(&mut self, config: &LoopConfig) -> Result<(), Refusal> {
        let _ = config;
        Ok(())
    }

    /// Reads the newest sample into `state`. Real-time: bounded, no allocation.
    fn read(&mut self, tick: &Tick, state: &mut DeviceState) -> Cycle;

    /// Commands the wrench on the hand until the next write; after a stop, `wrench` is zero until the next activation.
    /// Real-time: bounded, no allocation.
    fn write(&mut self, tick: &Tick, wrench: &Wrench) -> Cycle;

    /// Changes the live parameter at `index` at a tick boundary; the range is already checked. Real-time: bounded, no
    /// allocation.
    ///
    /// # Errors
    /// [`SetParameterError`]; the old value stays.
    fn set_parameter(&mut self, index: usize, value: f64) -> Result<(), SetParameterError> {
        let _ = (index, value);
        Err(SetParameterError::Fixed)
    }
}

/// Parts of an opened [`SimpleDevice`].
#[derive(Debug)]
pub struct Opened<D: SimpleDevice> {
    /// The device, not energised.
    pub device: D,
    /// Capabilities, constant from now on.
    pub capabilities: Capabilities,
    /// Handle that removes the force from another thread.
    pub stop: D::Stop,
}

/// Flag set by a stop and cleared by the next activation, for devices whose force is a number in memory.
#[derive(Clone, Debug, Default)]
pub struct StopFlag(Arc<AtomicBool>);

impl StopFlag {
    /// Returns true from a stop to the next activation. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn is_set(&self) -> bool {
        self.0.load(Ordering::Acquire)
    }
}

impl SafeStop for StopFlag {
    fn safe_stop(&self) {
        self.0.store(true, Ordering::Release);
    }

    fn arm(&self) {
        self.0.store(false, Ordering::Release);
    }
}

/// Stop handle of a [`Simple`] device: triggers the stop handle of the [`SimpleDevice`] and replaces later commands with zero until
/// the next activation.
pub struct SimpleStop<S>(Arc<(StopFlag, S)>);

impl<S> Clone for SimpleStop<S> {
    fn clone(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

impl<S: SafeStop> SafeStop for SimpleStop<S> {
    fn safe_stop(&self) {
        let (flag, part) = &*self.0;
        flag.safe_stop();
        part.safe_stop();
    }

    fn arm(&self) {
        let (flag, part) = &*self.0;
        flag.arm();
        part.arm();
    }
}

/// Adapter from a [`SimpleDevice`] to a [`Device`], not energised.
pub struct Simple<D: SimpleDevice> {
    device: D,
    capabilities: Capabilities,
    stop: SimpleStop<D::Stop>,
    /// Values of the parameters, by index.
    values: Vec<f64>,
}

/// Adapter from a [`SimpleDevice`] to an [`ActiveDevice`]; dropping stops the device.
pub struct ActiveSimple<D: SimpleDevice> {
    /// Dropped first: the force is zero before code of the device runs in its `drop`.
    _stop: StopOnDrop<D::Stop>,
    simple: Simple<D>,
}

struct StopOnDrop<S: SafeStop>(SimpleStop<S>);

impl<S: SafeStop> Drop for StopOnDrop<S> {
    fn drop(&mut self) {
        self.0.safe_stop();
    }
}

impl<D: SimpleDevice> Device for Simple<D> {
    const INFO: DeviceInfo = D::INFO;
    const PARAMETERS: &'static [Parameter] = D::PARAMETERS;
    type Active = ActiveSimple<D>;
    type Stop = SimpleStop<D::Stop>;

    fn open(settings: &Settings<'_>) -> Result<Self, Refusal> {
        let Opened { device, capabilities, stop } = D::open(settings)?;
        let stop = SimpleStop(Arc::new((StopFlag::default(), stop)));
        Ok(Self { device, capabilities, stop, values: settings.values() })
    }

    fn capabilities(&self) -> Capabilities {
        self.capabilities
    }

    fn stopper(&self) -> Self::Stop {
        self.stop.clone()
    }

    fn activate(mut self, config: &LoopConfig) -> Result<ActiveSimple<D>, (Self, Refusal)> {
        self.stop.arm();
        match self.device.activate(config) {
            Ok(()) => Ok(ActiveSimple { _stop: StopOnDrop(self.stop.clone()), simple: self }),
            Err(refusal) => {
                self.stop.safe_stop();
                Err((self, refusal))
            }
        }
    }

    fn parameter(&self, index: usize) -> f64 {
        self.values.get(index).copied().unwrap_or(f64::NAN)
    }
}

impl<D: SimpleDevice + IndependentStopDevice> IndependentStopDevice for Simple<D> {
    fn independent_stop(&self) -> IndependentStop {
        self.device.independent_stop()
    }
}

impl<D: SimpleDevice> ActiveDevice for ActiveSimple<D> {
    type Opened = Simple<D>;

    #[inline]
    fn read(&mut self, tick: &Tick, state: &mut DeviceState) -> Cycle {
        self.simple.device.read(tick, state)
    }

    #[inline]
    fn write(&mut self, tick: &Tick, wrench: &Wrench) -> Cycle {
        let is_stopped = self.simple.stop.0.0.is_set();
        self.simple.device.write(tick, if is_stopped { &Wrench::ZERO } else { wrench })
    }

    fn set_parameter(&mut self, index: usize, value: f64) -> Result<(), SetParameterError> {
        self.simple.device.set_parameter(index, value)?;
        if let Some(place) = self.simple.values.get_mut(index) {
            *place = value;
        }
        Ok(())
    }

    fn deactivate(self) -> Simple<D> {
        self.simple
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Axes;
    use std::sync::Mutex;

    /// Calls in order: stops, drops of the device, and forces written along z, N.
    static CALLS: Mutex<Vec<String>> = Mutex::new(Vec::new());

    fn note(call: impl Into<String>) {
        CALLS.lock().unwrap().push(call.into());
    }

    struct Noting {
        refuses: bool,
    }

    struct NotingStop;

    impl SafeStop for NotingStop {
        fn safe_stop(&self) {
            note("stop");
        }

        fn arm(&self) {
            note("arm");
        }
    }

    impl Drop for Noting {
        fn drop(&mut self) {
            note("drop");
        }
    }

    impl SimpleDevice for Noting {
        const INFO: DeviceInfo = DeviceInfo::new("noting", "Noting", "Notes its calls");
        type Stop = NotingStop;

        fn open(_: &Settings<'_>) -> Result<Opened<Self>, Refusal> {
            let capabilities = Capabilities::driving(Axes::Z).with_range(0.01, 0.2).with_limits(5.0, 0.5);
            Ok(Opened { device: Self { refuses: true }, capabilities, stop: NotingStop })
        }

        fn activate(&mut self, _: &LoopConfig) -> Result<(), Refusal> {
            if std::mem::take(&mut self.refuses) { Err(Refusal::resource("not yet")) } else { Ok(()) }
        }

        fn read(&mut self, _: &Tick, _: &mut DeviceState) -> Cycle {
            Cycle::Fresh
        }

        fn write(&mut self, _: &Tick, wrench: &Wrench) -> Cycle {
            note(format!("write {}", wrench.force().z));
            Cycle::Fresh
        }
    }

    #[test]
    fn a_stop_holds_until_the_next_activation_and_comes_before_every_drop() {
        let config = LoopConfig { period_ns: 1_000_000, seed: 0 };
        let opened = Simple::<Noting>::open(&Settings::defaults(Noting::PARAMETERS)).unwrap();
        let Capabilities { range_m, range_rad, max_force_n, max_torque_nm, .. } = opened.capabilities();
        assert_eq!((range_m, range_rad), ([0.0, 0.0, 0.01], [0.0; 3]), "of the sensed axes alone");
        assert_eq!((max_force_n, max_torque_nm), ([0.0, 0.0, 5.0], [0.0; 3]), "of the driven axes alone");
        let stopper = opened.stopper();
        // A refused activation leaves the device stopped and open.
        let Err((opened, _)) = opened.activate(&config) else { panic!("the first activation is refused") };
        let Ok(mut active) = opened.activate(&config) else { panic!("the second is not") };
        let push = |active: &mut ActiveSimple<Noting>| {
            assert_eq!(active.write(&Tick::default(), &Wrench::from_force(crate::DVec3::Z)), Cycle::Fresh);
        };
        push(&mut active);
        stopper.safe_stop();
        push(&mut active);
        let Ok(mut active) = active.deactivate().activate(&config) else { panic!("it activates again") };
        push(&mut active);
        drop(active);
        let calls = std::mem::take(&mut *CALLS.lock().unwrap());
        let expected =
            ["arm", "stop", "arm", "write 1", "stop", "write 0", "stop", "arm", "write 1", "stop", "drop"];
        assert_eq!(calls, expected);
    }
}
