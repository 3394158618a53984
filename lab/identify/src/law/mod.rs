//! Force laws of the ladder: their parameters and the force for a measured displacement.
//!
//! A law gives the force on the object at each sample as a level and, where the force depends on the velocity `v`, an impulse
//! whose rate of change adds to the level: with the depth `d`, the damping `c(d) v` of a law is `d/dt ∫ c(d) dd`. The rate of
//! change of a mean over some samples needs the impulse at both ends only, so the noisy displacement is not differentiated sample
//! by sample.

mod elastic;
mod hysteresis;
mod table;
mod zener;

use crate::measurement::{Measurement, lowest, span};
use flotor_hal::math;

/// Force law.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Law {
    /// `F = k d`.
    Linear,
    /// `F = k d^1.5` (Hertz 1881): a ball on a half-space.
    Hertz,
    /// `F = k d + k_c max(0, d - t)`: a helical spring whose coils touch after the travel `t`.
    Spring,
    /// `F = k d^n (1 + lambda v)` (Hunt and Crossley 1975).
    HuntCrossley,
    /// Spring `k` parallel to a spring `E` in series with a damper: `F = k d + q`, `dq/dt = E v - q / tau` (Zener 1948).
    Zener,
    /// `F = k d + z` with a spring `kappa` in series with a dry friction `|z| <= f` (Prandtl 1928).
    Hysteresis,
    /// Smooth curve through knots, independent of velocity and direction.
    Table,
}

/// Connection between tool and object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Connection {
    /// The tool only presses: no force without depth, and no pull.
    Presses,
    /// The object is attached to the tool, and also pulled.
    Attached,
}

/// Parameter of a law.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Form {
    pub(crate) id: &'static str,
    pub(crate) coordinate: Coordinate,
    /// Prior mean and standard deviation of the coordinate, so weak that any informative data outweigh it.
    pub(crate) prior: Option<(f64, f64)>,
}

/// Relation of a parameter to the coordinate of the fit, which is of order one for any units of the measurement.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Coordinate {
    /// Displacement: smallest displacement plus the coordinate times the span.
    Displacement,
    /// Positive parameter: exponential of the coordinate, in this unit.
    Positive(Unit),
    /// Parameter of any sign: the coordinate, in this unit.
    Signed(Unit),
}

/// Unit of a parameter as powers of the measurement's scales of force, length and time.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Unit {
    force: f64,
    length: f64,
    time: f64,
}

impl Unit {
    /// Returns true for a duration.
    pub(crate) fn is_time(self) -> bool {
        self.time == 1.0 && self.force == 0.0 && self.length == 0.0
    }
}

/// Motion of the probe.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Motion<'a> {
    /// Times of the samples, s.
    pub(crate) time_s: &'a [f64],
    /// Displacements, m.
    pub(crate) displacement_m: &'a [f64],
    /// Displacements with reduced noise, m, for an element that responds to every reversal.
    pub(crate) smooth_m: &'a [f64],
}

/// Scales of a measurement.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scales {
    pub(crate) lowest_m: f64,
    pub(crate) span_m: f64,
    pub(crate) force_n: f64,
    /// Characteristic time: span of the displacement over the root mean square of its velocity, s.
    pub(crate) time_s: f64,
}

impl Scales {
    pub(crate) fn of(measurement: &Measurement) -> Self {
        let (x, f) = (measurement.displacement_m(), measurement.force_n());
        let (lowest_m, span_m) = (lowest(x), span(x));
        let force_n = f.iter().map(|force_n| force_n.abs()).fold(0.0, f64::max);
        let time_s = measurement.time_s().map_or(1.0, |time_s| {
            // Use means of samples: the noise of single samples would count as velocity.
            let coarse = measurement.coarse(400);
            let path_m: f64 = coarse.displacement_m().windows(2).map(|pair| (pair[1] - pair[0]).abs()).sum();
            span_m * span(time_s) / path_m.max(span_m)
        });
        Self { lowest_m, span_m, force_n, time_s }
    }

    fn unit(&self, unit: Unit) -> f64 {
        math::pow(self.force_n, unit.force)
            * math::pow(self.span_m, unit.length)
            * math::pow(self.time_s, unit.time)
    }

    /// Converts a coordinate of the fit to the parameter.
    pub(crate) fn parameter(&self, form: &Form, coordinate: f64) -> f64 {
        match form.coordinate {
            Coordinate::Displacement => self.lowest_m + self.span_m * coordinate,
            Coordinate::Positive(unit) => self.unit(unit) * math::exp(coordinate.clamp(-200.0, 200.0)),
            Coordinate::Signed(unit) => self.unit(unit) * coordinate,
        }
    }
}

/// Response of a law to the motion of a measurement: force on the object at each sample.
#[derive(Clone, Debug)]
pub(crate) struct Response {
    /// Part of the force without the impulse, N.
    pub(crate) level_n: Vec<f64>,
    /// Impulse whose rate of change is the other part of the force, N·s; empty without one.
    pub(crate) impulse_ns: Vec<f64>,
}

impl Response {
    fn level(level_n: Vec<f64>) -> Self {
        Self { level_n, impulse_ns: Vec::new() }
    }
}

const NONE: Unit = Unit { force: 0.0, length: 0.0, time: 0.0 };
const FORCE: Unit = Unit { force: 1.0, ..NONE };
const LENGTH: Unit = Unit { length: 1.0, ..NONE };
const TIME: Unit = Unit { time: 1.0, ..NONE };
const STIFFNESS: Unit = Unit { force: 1.0, length: -1.0, time: 0.0 };
const HERTZ: Unit = Unit { force: 1.0, length: -1.5, time: 0.0 };
const DISSIPATION: Unit = Unit { force: 0.0, length: -1.0, time: 1.0 };

const fn positive(id: &'static str, unit: Unit) -> Form {
    Form { id, coordinate: Coordinate::Positive(unit), prior: None }
}

const fn signed(id: &'static str, unit: Unit) -> Form {
    Form { id, coordinate: Coordinate::Signed(unit), prior: None }
}

const fn around(form: Form, mean: f64, deviation: f64) -> Form {
    Form { prior: Some((mean, deviation)), ..form }
}

const CONTACT: Form = Form { id: "contact_m", coordinate: Coordinate::Displacement, prior: None };

impl Law {
    /// All laws.
    pub const ALL: [Self; 7] = [
        Self::Linear,
        Self::Hertz,
        Self::Spring,
        Self::HuntCrossley,
        Self::Zener,
        Self::Hysteresis,
        Self::Table,
    ];

    /// Returns the name of the law on the command line and in results.
    #[must_use]
    pub const fn id(self) -> &'static str {
        match self {
            Self::Linear => "linear",
            Self::Hertz => "hertz",
            Self::Spring => "spring",
            Self::HuntCrossley => "hunt-crossley",
            Self::Zener => "zener",
            Self::Hysteresis => "hysteresis",
            Self::Table => "table",
        }
    }

    /// Returns true if the force depends on the velocity or on times.
    #[must_use]
    pub const fn has_rate(self) -> bool {
        matches!(self, Self::HuntCrossley | Self::Zener)
    }

    /// Returns the parameters in the order of the coordinates of a fit: for the table the forces at the knots; for other laws the
    /// amplitude is first and the contact last.
    pub(crate) fn forms(self) -> &'static [Form] {
        const K: Form = positive("stiffness_n_per_m", STIFFNESS);
        const KH: Form = positive("hertz_n_per_m_1_5", HERTZ);
        match self {
            Self::Linear => &[K, CONTACT],
            Self::Hertz => &[KH, CONTACT],
            Self::Spring => {
                const {
                    &[
                        K,
                        around(positive("travel_m", LENGTH), -0.4, 1.0),
                        around(positive("coil_contact_n_per_m", STIFFNESS), 1.0, 4.0),
                        CONTACT,
                    ]
                }
            }
            Self::HuntCrossley => {
                const {
                    &[
                        KH,
                        around(signed("exponent", NONE), 1.5, 1.0),
                        around(signed("dissipation_s_per_m", DISSIPATION), 0.0, 20.0),
                        CONTACT,
                    ]
                }
            }
            Self::Zener => {
                const {
                    &[
                        K,
                        around(positive("maxwell_n_per_m", STIFFNESS), 0.0, 4.0),
                        around(positive("relaxation_s", TIME), -1.0, 4.0),
                        CONTACT,
                    ]
                }
            }
            Self::Hysteresis => {
                const {
                    &[
                        K,
                        around(positive("sticking_n_per_m", STIFFNESS), 2.0, 3.0),
                        around(positive("friction_n", FORCE), -2.0, 4.0),
                        CONTACT,
                    ]
                }
            }
            Self::Table => &table::KNOTS,
        }
    }

    /// Returns the response to a motion, with the parameters in the order of [`Self::forms`].
    pub(crate) fn respond(
        self,
        parameters: &[f64],
        connection: Connection,
        scales: &Scales,
        motion: Motion<'_>,
    ) -> Response {
        let Motion { time_s, displacement_m, smooth_m } = motion;
        let depth = move |x: &f64, contact_m: f64| match connection {
            Connection::Presses => (x - contact_m).max(0.0),
            Connection::Attached => x - contact_m,
        };
        let depths = |contact_m: f64| displacement_m.iter().map(move |x| depth(x, contact_m));
        match (self, parameters) {
            (Self::Linear, &[k, contact]) => Response::level(depths(contact).map(|d| k * d).collect()),
            (Self::Hertz, &[k, contact]) => {
                Response::level(depths(contact).map(|d| elastic::hertz(k, d)).collect())
            }
            (Self::Spring, &[k, travel, coils, contact]) => {
                Response::level(depths(contact).map(|d| elastic::spring(k, travel, coils, d)).collect())
            }
            (Self::HuntCrossley, &[k, exponent, dissipation, contact]) => {
                elastic::hunt_crossley(k, exponent, dissipation, depths(contact))
            }
            (Self::Zener, &[k, maxwell, relaxation, contact]) => {
                let level_n = zener::force_n(k, maxwell, relaxation, time_s, depths(contact));
                Response::level(connection.limited(level_n))
            }
            (Self::Hysteresis, &[k, sticking, friction, contact]) => {
                let level_n = hysteresis::force_n(
                    k,
                    sticking,
                    friction,
                    depths(contact),
                    smooth_m.iter().map(|x| depth(x, contact)),
                );
                Response::level(connection.limited(level_n))
            }
            (Self::Table, knots) => Response::level(table::force_n(knots, scales, displacement_m)),
            _ => Response::level(vec![f64::NAN; displacement_m.len()]),
        }
    }

    /// Returns initial guesses of the coordinates, for each initial guess of the contact in `contacts`. The fit sets the
    /// amplitude.
    pub(crate) fn starts(self, contacts: &[f64]) -> Vec<Vec<f64>> {
        let shapes: &[&[f64]] = match self {
            Self::Linear | Self::Hertz => &[&[]],
            Self::Spring => &[&[-0.7, 1.0], &[-0.2, 1.5]],
            Self::HuntCrossley => &[&[1.1, 0.0], &[1.5, 0.0], &[2.2, 0.0]],
            Self::Zener => &[&[-0.7, -4.5], &[-0.7, -2.5], &[-0.7, -0.5], &[-0.7, 1.5]],
            Self::Hysteresis => &[&[1.5, -3.0], &[3.5, -2.3]],
            Self::Table => return vec![vec![0.0; table::KNOTS.len()]],
        };
        let starts = shapes
            .iter()
            .flat_map(|shape| contacts.iter().map(|contact| [&[0.0], *shape, &[*contact]].concat()));
        starts.collect()
    }
}

impl Connection {
    /// Limits the force to at least 0 if the tool only presses.
    pub(crate) fn limited(self, mut force_n: Vec<f64>) -> Vec<f64> {
        if self == Self::Presses {
            force_n.iter_mut().for_each(|force_n| *force_n = force_n.max(0.0));
        }
        force_n
    }
}

/// Returns the displacement of a knot of the table, m.
pub(crate) fn knot_displacement_m(scales: &Scales, index: usize) -> f64 {
    scales.lowest_m + scales.span_m * index as f64 / (table::KNOTS.len() - 1) as f64
}
