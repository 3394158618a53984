//! Parameter schema: every parameter with unit, range, default and documentation.

use crate::hand::Script;
use crate::plant::FlotorParameters;
use flotor_hal::{Choices, Parameter, choices};

/// Scope of the simulation.
const PRESETS: Choices = choices!["plain", "full"];

/// Flotors with published data.
const FLOTORS: Choices = choices!["thesis", "utah"];

/// Intended motions of the hand.
const HANDS: Choices = choices!["oscillate", "press", "release", "hold", "open"];

/// Built-in scripts.
const SCRIPTS: Choices = choices!(= &Script::NAMES);

/// Grips of the hand.
const GRIPS: Choices = choices!["firm", "relaxed"];

/// Presence of a grip.
const FINGERS: Choices = choices!["off", "on"];

/// Velocity estimators.
const ESTIMATORS: Choices = choices!["low-pass", "difference", "kalman"];

/// Kinds of faults.
const FAULTS: Choices = choices![
    "none",
    "sensor-loss",
    "late-sample",
    "duplicate-sample",
    "dropped-sample",
    "stuck-axis",
    "coil-open",
    "over-temperature",
    "cable-pull",
    "clock-jitter"
];

const DEMO: FlotorParameters = FlotorParameters::THESIS;

/// Declares a principal moment of inertia.
const fn inertia(id: &'static str, default: f64, doc: &'static str) -> Parameter {
    Parameter::real(id, "kg m²", 1.0e-6, 1.0, default, doc)
}

/// Declares a coordinate of the guide's target.
const fn target(id: &'static str, doc: &'static str) -> Parameter {
    Parameter::real(id, "mm", -50.0, 50.0, 0.0, doc).live()
}

/// Declares the angle of a ring of coils.
const fn ring(id: &'static str, default: f64, doc: &'static str) -> Parameter {
    Parameter::real(id, "°", 0.0, 90.0, default, doc)
}

/// Declares the azimuth of an LED.
const fn led(id: &'static str, default: f64, doc: &'static str) -> Parameter {
    Parameter::real(id, "°", -360.0, 360.0, default, doc)
}

/// Schema of the parameters. Defaults are those of preset `plain`, flotor `thesis`, an oscillating firm hand.
pub(crate) const SCHEMA: &[Parameter] = &[
    Parameter::choice(
        "preset",
        PRESETS,
        0,
        "Extent of the simulation: plain has rigid body, gravity, drag and hand; full adds coils, sensors \
         and faults",
    ),
    Parameter::choice("flotor", FLOTORS, 0, "Default mass and centre of mass: of the thesis, or of the Utah device"),
    Parameter::real("mass_kg", "kg", 0.01, 10.0, DEMO.mass_kg, "Mass of the flotor (default for the Utah device: 0.555 kg)"),
    inertia("inertia_x_kg_m2", DEMO.inertia_kg_m2.x, "Moment of inertia about the centre of mass, x"),
    inertia("inertia_y_kg_m2", DEMO.inertia_kg_m2.y, "Moment of inertia about the centre of mass, y"),
    inertia("inertia_z_kg_m2", DEMO.inertia_kg_m2.z, "Moment of inertia about the centre of mass, z"),
    Parameter::real("com_x_mm", "mm", -100.0, 100.0, 0.0, "Centre of mass in the flotor frame, x (default for the Utah device: 0.614 mm)"),
    Parameter::real("com_y_mm", "mm", -100.0, 100.0, 0.0, "Centre of mass in the flotor frame, y (default for the Utah device: 1.225 mm)"),
    Parameter::real("com_z_mm", "mm", -100.0, 100.0, -31.7, "Centre of mass in the flotor frame, z (default for the Utah device: -31.669 mm)"),
    Parameter::real("gravity_m_per_s2", "m/s²", 0.0, 30.0, DEMO.gravity_m_per_s2, 
        "Gravitational acceleration, downwards"),
    Parameter::real(
        "feedforward_n",
        "N",
        -50.0,
        50.0,
        0.58 * DEMO.gravity_m_per_s2,
        "Upward force at the centre of mass that compensates gravity (default: exactly the weight)",
    ),
    Parameter::real(
        "damping_ns_per_m",
        "N s/m",
        0.0,
        100.0,
        DEMO.drag.translational_ns_per_m,
        "Eddy-current drag on translation",
    ),
    Parameter::real(
        "damping_nms_per_rad",
        "N m s/rad",
        0.0,
        10.0,
        DEMO.drag.rotational_nms_per_rad,
        "Eddy-current drag on rotation",
    ),
    Parameter::choice("hand", HANDS, 0, "Intended motion of the hand; open: the hand does not hold the handle"),
    Parameter::file(
        "hand_script",
        SCRIPTS,
        "Intended motion of the hand, step by step: a TOML file or a built-in script; overrides `hand`",
    ),
    Parameter::file(
        "hand_recording",
        choices![],
        "Intended motion of the hand: the path of a handle in a recording (.mcap) or a table (.csv); overrides `hand`",
    ),
    Parameter::real(
        "hand_tremor_um",
        "µm",
        0.0,
        1000.0,
        0.0,
        "Tremor of the hand along each axis at 8 to 12 Hz, rms (a braced hand has 15 to 250 µm)",
    ),
    Parameter::real(
        "hand_force_noise_percent",
        "%",
        0.0,
        50.0,
        0.0,
        "Noise of the pushing forces of a script, rms (people have 3 to 5 %)",
    ),
    Parameter::choice(
        "hand_grip",
        GRIPS,
        0,
        "Grip of the hand: impedance from the literature (default with a script that has a grip: that grip)",
    ),
    Parameter::real(
        "hand_stiffness_n_per_m",
        "N/m",
        0.0,
        20_000.0,
        2000.0,
        "Stiffness of the hand (default: the stiffness of the grip)",
    ),
    Parameter::real(
        "hand_damping_ns_per_m",
        "N s/m",
        0.0,
        1000.0,
        70.0,
        "Damping of the hand (default: the damping of the grip)",
    ),
    Parameter::real(
        "hand_mass_kg",
        "kg",
        0.0,
        5.0,
        0.5,
        "Mass of the hand that moves with the handle (default: the mass of the grip)",
    ),
    Parameter::real(
        "hand_centre_mm",
        "mm",
        -12.0,
        12.0,
        -4.0,
        "Oscillate: middle of the intended movement (negative is down)",
    ),
    Parameter::real(
        "hand_amplitude_mm",
        "mm",
        0.0,
        12.0,
        6.0,
        "Oscillate: half the distance between the intended turning points",
    ),
    Parameter::real("hand_frequency_hz", "Hz", 0.0, 20.0, 1.5, "Oscillate: cycles per second"),
    Parameter::real(
        "hand_depth_mm",
        "mm",
        -12.0,
        12.0,
        4.0,
        "Press, hold, release: intended depth below home",
    ),
    Parameter::real("hand_rise_s", "s", 0.01, 60.0, 1.0, "Oscillate, press: time until the full movement"),
    Parameter::real("hand_release_s", "s", 0.0, 3600.0, 1.0, "Release: time at which the hand opens"),
    Parameter::real(
        "hand_guide",
        "1",
        0.0,
        4_294_967_295.0,
        0.0,
        "Number of the client that guides the hand, chosen by the client; 0: none. Without a message for 1 s the hand is released",
    )
    .live(),
    target("hand_target_x_mm", "Guide: intended position of the handle, x; only with hand_guide"),
    target("hand_target_y_mm", "Guide: intended position of the handle, y; only with hand_guide"),
    target("hand_target_z_mm", "Guide: intended position of the handle, z; only with hand_guide"),
    Parameter::choice("fingers", FINGERS, 0, "Grip between the fingers of the hand: none, or one of 25 mm and 8 N"),
    Parameter::real("fingers_mass_kg", "kg", 0.005, 1.0, 0.02, "Fingers: mass that moves with the grip"),
    Parameter::real(
        "fingers_stiffness_n_per_m",
        "N/m",
        0.0,
        5000.0,
        400.0,
        "Fingers: stiffness of the hand about the intended opening",
    ),
    Parameter::real(
        "fingers_damping_ns_per_m",
        "N s/m",
        0.0,
        20.0,
        4.0,
        "Fingers: damping of the hand about the intended opening",
    ),
    Parameter::real(
        "fingers_closed_mm",
        "mm",
        0.0,
        25.0,
        5.0,
        "Fingers: intended opening of the closed grip",
    ),
    Parameter::real(
        "fingers_frequency_hz",
        "Hz",
        0.0,
        10.0,
        1.0,
        "Fingers: cycles of closing and opening per second",
    ),
    Parameter::real("start_x_mm", "mm", -12.0, 12.0, 0.0, "Initial position of the flotor, x"),
    Parameter::real("start_y_mm", "mm", -12.0, 12.0, 0.0, "Initial position of the flotor, y"),
    Parameter::real("start_z_mm", "mm", -12.0, 12.0, 0.0, "Initial position of the flotor, z"),
    Parameter::real("coil_radius_mm", "mm", 10.0, 500.0, 115.0, "Full: radius of the hemisphere of coils"),
    ring("coil_ring_a_deg", 65.0, "Full: angle of coil ring A (force along the meridian) from the bottom"),
    ring("coil_ring_b_deg", 45.0, "Full: angle of coil ring B (force along the parallel) from the bottom"),
    Parameter::real(
        "coil_force_n",
        "N",
        1.0,
        1000.0,
        51.5,
        "Full: force of a coil at its largest current, 3.5 A",
    ),
    Parameter::real("amplifier_bandwidth_hz", "Hz", 1.0, 1.0e6, 2000.0, "Full: bandwidth of the amplifiers"),
    Parameter::real(
        "field_error_percent",
        "%",
        0.0,
        50.0,
        10.87,
        "Full: variation of the ratio of delivered to commanded vertical force, peak to peak over heights of -7 to \
         7 mm from home",
    ),
    Parameter::real("coil_ambient_c", "°C", -40.0, 300.0, 20.0, "Full: ambient temperature of the coils"),
    Parameter::real(
        "coil_rise_k_per_a2",
        "K/A²",
        0.0,
        1000.0,
        40.0,
        "Full: steady-state temperature rise of a coil over its squared current",
    ),
    Parameter::real("coil_lag_s", "s", 0.1, 3600.0, 120.0, "Full: thermal time constant of a coil"),
    Parameter::real("led_radius_mm", "mm", 1.0, 120.0, 60.0, "Full: radius of the circle of LEDs"),
    led("led_2_deg", 120.0, "Full: angle of the second LED on the circle of LEDs, from the first"),
    led("led_3_deg", 240.0, "Full: angle of the third LED on the circle of LEDs, from the first"),
    Parameter::real(
        "sensor_noise_um",
        "µm",
        0.0,
        100.0,
        1.0,
        "Full: noise of each coordinate at the LED, rms",
    ),
    Parameter::real(
        "sensor_resolution_um",
        "µm",
        0.0,
        100.0,
        2.0,
        "Full: resolution of each coordinate at the LED; 0: no steps (real devices have 2, 5 or 10 µm)",
    ),
    Parameter::real("sensor_edge_percent", "%", 0.0, 20.0, 1.0, 
        "Full: nonlinearity of a position-sensing cell at its edge, as a fraction of its half width (grows with \
         the cube of the distance from the centre)"),
    Parameter::real(
        "sensor_bandwidth_hz",
        "Hz",
        0.0,
        1.0e5,
        0.0,
        "Full: bandwidth of the position-sensing cells; 0: no limit (for comparison, the real device as a whole has 125 Hz)",
    ),
    Parameter::real(
        "sensor_latency_ticks",
        "1",
        0.0,
        64.0,
        1.0,
        "Full: latency of a sample, in ticks of the device's own controller (1 ms at every rate of the loop), rounded",
    ),
    Parameter::choice("velocity", ESTIMATORS, 0, "Full: method of estimating velocity from the poses"),
    Parameter::real(
        "velocity_bandwidth_hz",
        "Hz",
        0.1,
        1.0e4,
        200.0,
        "Full: cutoff frequency of the low-pass velocity estimate; no effect with other methods",
    ),
    Parameter::real(
        "velocity_acceleration_m_per_s2",
        "m/s²",
        1.0e-3,
        1.0e3,
        2.0,
        "Full: acceleration expected by the Kalman velocity estimate; no effect with other methods",
    ),
    Parameter::choice("fault", FAULTS, 0, "Full: kind of fault"),
    Parameter::real("fault_time_s", "s", 0.0, 3600.0, 1.0, 
        "Full: time of the fault from the start of the run; no effect with random faults"),
    Parameter::real("fault_duration_s", "s", 0.0, 3600.0, 0.01, "Full: duration of the fault"),
    Parameter::real(
        "fault_rate_per_s",
        "1/s",
        0.0,
        1000.0,
        0.0,
        "Full: mean rate of random faults per second (0: one fault, at fault_time_s)",
    ),
    Parameter::real(
        "fault_index",
        "1",
        0.0,
        5.0,
        0.0,
        "Full: index, from 0, of the stuck axis (x, y, z, rotations) or of the open coil",
    ),
];
