//! Published numbers of the magnetic-levitation haptic device (MLHD), each with its source.
//!
//! Sources: *thesis* is CMU-RI-TR-07-21 (2007), section 2; *IJRR* is Berkelman and Hollis, International Journal
//! of Robotics Research 19(7), 2000; *client* is the public client code of the device's later users.

/// Range of the handle along each axis, to both sides of the centre, m (thesis).
pub const RANGE_M: f64 = 0.012;
/// Range of the handle about each axis, to both sides of the centre, rad: 7 degrees (thesis).
pub const RANGE_RAD: f64 = 0.122_173_047_639_603_07;
/// Largest force on the weakest and on the strongest axis, N (thesis).
pub const MAX_FORCE_N: [f64; 2] = [55.0, 140.0];
/// Largest torque about the weakest and about the strongest axis, N·m (thesis).
pub const MAX_TORQUE_NM: [f64; 2] = [6.3, 12.2];
/// Largest stiffness rendered in unilateral contact, N/m (thesis).
pub const MAX_STIFFNESS_N_PER_M: f64 = 25_000.0;
/// Largest rotational stiffness, N·m/rad (thesis).
pub const MAX_STIFFNESS_NM_PER_RAD: f64 = 50.0;
/// Best and worst position resolution of the prototype, m (thesis, IJRR).
pub const RESOLUTION_M: [f64; 2] = [5.0e-6, 10.0e-6];
/// Lowest and highest servo rate of the controller, Hz (client).
pub const SERVO_RATE_HZ: [f64; 2] = [100.0, 10_000.0];
/// Largest current per coil, A (client).
pub const MAX_COIL_CURRENT_A: f64 = 3.5;
/// Three masses of the flotor in the literature, kg: mass in the thesis; from the weight of 6.9 N measured in the thesis;
/// client.
pub const FLOTOR_MASS_KG: [f64; 3] = [0.58, 6.9 / 9.806_65, 0.555];
