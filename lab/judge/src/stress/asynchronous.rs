//! M11, asynchronous: what a loop of 1 kHz makes of the contacts or the local linear model of a slower model.
//!
//! A hand moves back and forth through home, each time along another line, at 1, 3 and 8 Hz. The model answers 50 to 500 times a
//! second at the pose of the hand; as on the virtual clock of a run, the loop uses each answer one period of the model later, with the
//! code of a run ([`flotor_contact`]) but without a cap of the stiffness. For each rate:
//!
//! - **Pull**, the judged value: the component of the force against the push of the newest answer at its own pose. Contacts only push.
//!   A local linear model continues through zero where the handle leaves, so an object sticks to the hand: it is noted.
//! - **Energy** given to the hand by whole periods of its motion, beside that of the same model stepped in the loop. More than
//!   1.15 times as much and 0.02 mJ is noted.
//! - **Step**: the largest change of the force from one tick to the next, beside that of the model in the loop.
//! - **Age** of the oldest answer in use, with the longest time that an answer took on this machine.

use super::measure::{Measure, Verdict};
use super::sweep::sweep;
use super::{PERIOD_S, Setup};
use crate::PERIOD_NS;
use crate::sampling::Random;
use crate::subject::{Subject, prepared_for};
use crate::tally::{Worst, tally};
use crate::trajectory::at;
use crate::watch::enter_call;
use flotor_contact::{
    ContactSetError, Coupling, CrossFade, Limits, PublishedContacts, Replacement, Solver, StableStiffness,
};
use flotor_hal::abi::CallStatus;
use flotor_hal::{ContactSet, DVec3, Demand, Input, LoopConfig, StepStatus, Twist, math};
use flotor_loader::{LoadError, Model};
use std::f64::consts::TAU;
use std::time::Instant;

const NAME: &str = "asynchronous";
/// Periods of the model, ticks of the loop: 50, 100, 200 and 500 Hz.
const MODEL_TICKS: [u64; 4] = [20, 10, 5, 2];
/// Periods of the hand, ticks of the loop: 1, 3 and 8 Hz.
const HAND_TICKS: [u64; 3] = [1000, 333, 125];
/// Periods of the hand in a run: the model has no contacts before the first.
const LAPS: u64 = 2;
/// Amplitude of the hand, relative to the workspace: 1.5 mm of 20 mm.
const AMPLITUDE: f64 = 0.075;
/// Largest pull that counts as rounding, N.
const ROUNDING_N: f64 = 1.0e-9;
/// Energy given to the hand that is noted: more than this ratio of the energy that the model in the loop gives, and this many J.
const RATIO: f64 = 1.15;
const NOTED_J: f64 = 2.0e-5;
/// Power of a surface that moves by itself, W: the default of a scene.
const SURFACE_POWER_W: f64 = 1.0;
/// Periods of the model after which a set without a validity of its own fades, as in a run.
const VALID_PERIODS: f64 = 3.0;

tally! {
    struct Tally {
        runs: u64,
        /// Ticks with a force.
        felt: u64,
        /// Answers with a bilateral part.
        bilateral: u64,
        /// Answers that the loop has used, and calls without an answer.
        answers: u64,
        unanswered: u64,
        refused: u64,
        first_refusal: Option<String>,
        slowest_s: f64,
        by_rate: [AtRate; MODEL_TICKS.len()],
        broken: Option<LoadError>,
    }
}

tally! {
    struct AtRate {
        pull_n: Worst,
        pulling_ticks: u64,
        given_j: f64,
        given_in_loop_j: f64,
        /// Energy beyond the ratio to that of the model in the loop, J.
        beyond_j: f64,
        step_n: f64,
        step_in_loop_n: f64,
    }
}

/// Motion of a hand, and rate of the model.
#[derive(Clone, Copy)]
struct Run {
    amplitude_m: DVec3,
    hand_ticks: u64,
    rate: usize,
}

impl Run {
    /// Returns the run of a block: for each line all rates and hands. The first line is vertical.
    fn of(setup: &Setup<'_>, block: u64) -> Self {
        let (hands, rates) = (HAND_TICKS.len() as u64, MODEL_TICKS.len() as u64);
        let line = block / (hands * rates);
        let mut random = Random::new(setup.options.seed, line);
        let direction =
            if line == 0 { DVec3::Z } else { random.vector().try_normalize().unwrap_or(DVec3::Z) };
        #[allow(clippy::cast_possible_truncation)] // below the lengths of the lists
        let [hand, rate] = [block % hands, block / hands % rates].map(|index| index as usize);
        let amplitude_m = direction * (AMPLITUDE * setup.options.reach.position_m);
        Self { amplitude_m, hand_ticks: HAND_TICKS[hand], rate }
    }

    fn position_m(&self, tick: u64) -> DVec3 {
        let (_, cosine) = math::sin_cos(self.angle(tick));
        self.amplitude_m * cosine
    }

    fn input(&self, tick: u64) -> Input {
        let (sine, _) = math::sin_cos(self.angle(tick));
        let rate_per_s = TAU / (self.hand_ticks as f64 * PERIOD_S);
        let twist = Twist::new(self.amplitude_m * (-sine * rate_per_s), DVec3::ZERO);
        let pose = at(self.position_m(tick), DVec3::ZERO);
        Input { tick, time_ns: tick * PERIOD_NS, dt_ns: PERIOD_NS, twist, ..Input::at_rest(pose) }
    }

    fn angle(&self, tick: u64) -> f64 {
        TAU * (tick % self.hand_ticks) as f64 / self.hand_ticks as f64
    }
}

/// Force along a motion: energy given to the hand, and largest change from one tick to the next.
#[derive(Default)]
struct Felt {
    last_n: Option<DVec3>,
    given_j: f64,
    step_n: f64,
}

impl Felt {
    fn take(&mut self, force_n: DVec3, travel_m: DVec3) {
        self.given_j += force_n.dot(travel_m);
        self.step_n = self.step_n.max(self.last_n.map_or(0.0, |last_n| (force_n - last_n).length()));
        self.last_n = Some(force_n);
    }
}

/// Asynchronous model as the loop uses it.
struct Asynchronous {
    model: Model,
    period_ticks: u64,
    demand: Demand,
    contacts: PublishedContacts,
    fields: CrossFade,
    /// Answer with the tick of its release.
    computed: Option<(u64, ContactSet)>,
    /// Direction in which the newest answer with a force pushes; zero before.
    push: DVec3,
    unanswered: u64,
    slowest_s: f64,
}

impl Asynchronous {
    fn new(setup: &Setup<'_>, period_ticks: u64) -> Result<Self, LoadError> {
        let config = LoopConfig { period_ns: period_ticks * PERIOD_NS, seed: setup.options.seed };
        let model = prepared_for(setup.plugin, setup.settings, &config)?;
        let valid_s = VALID_PERIODS * period_ticks as f64 * PERIOD_S;
        let replacement = Replacement::Conserving { surface_power_w: SURFACE_POWER_W };
        let solver = Limits::new(f64::INFINITY, f64::INFINITY)
            .and_then(|limits| Solver::new(Coupling::RIGID, limits, replacement, PERIOD_S))
            .unwrap_or_else(|_| unreachable!("constants above 0"));
        Ok(Self {
            demand: Demand::WRENCH.limited_to(model.serves()),
            model,
            period_ticks,
            contacts: PublishedContacts::new(solver, StableStiffness::UNLIMITED, valid_s),
            fields: CrossFade::new(config.period_ns),
            computed: None,
            push: DVec3::ZERO,
            unanswered: 0,
            slowest_s: 0.0,
        })
    }

    /// Returns the force at an input, after a computation where one is due, and the answer that the loop uses from this tick on.
    fn force_n(&mut self, input: &Input) -> (DVec3, Option<Result<ContactSet, ContactSetError>>) {
        let due = self.computed.take_if(|(tick, _)| input.tick >= *tick);
        if input.tick.is_multiple_of(self.period_ticks) {
            self.compute(input);
        }
        let used = due.map(|(_, set)| self.contacts.publish(&set).map(|()| set));
        if let Some(Ok(set)) = &used {
            self.fields.take(set.bilateral(), &input.pose, input.time_ns);
            self.push = push(set).try_normalize().unwrap_or(self.push);
        }
        let (wrench, _) = self.fields.at(&input.pose, input.time_ns);
        let touch = self.contacts.touch(input);
        (touch.map_or(wrench, |touch| wrench + touch.wrench).force(), used)
    }

    fn compute(&mut self, input: &Input) {
        let dt_ns = if input.tick == 0 { 0 } else { self.period_ticks * PERIOD_NS };
        let input = Input { dt_ns, demand: self.demand, ..*input };
        let mut set = ContactSet::NONE;
        let begin = Instant::now();
        let status = {
            let _call = enter_call(std::slice::from_ref(&input));
            self.model.local_model(&input, &mut set)
        };
        self.slowest_s = self.slowest_s.max(begin.elapsed().as_secs_f64());
        if status == CallStatus::Ok {
            (set.time_ns, set.field.time_ns) = (input.time_ns, input.time_ns);
            self.computed = Some((input.tick + self.period_ticks, set));
        } else {
            self.unanswered += 1;
        }
    }
}

/// Returns the force of an answer at its own pose, N.
fn push(set: &ContactSet) -> DVec3 {
    let contacts = set.contacts().iter();
    let pushes = contacts.map(|contact| {
        DVec3::from_array(contact.normal) * (contact.stiffness_n_per_m * (-contact.gap_m).max(0.0))
    });
    pushes.sum::<DVec3>() + set.bilateral().wrench.force()
}

/// Measures pulling force, energy, force steps and age of results of an asynchronous model.
pub(super) fn measure(setup: &Setup<'_>) -> Result<Measure, LoadError> {
    let is_asynchronous = setup.subject()?.model().has_local_model();
    let runs = (HAND_TICKS.len() * MODEL_TICKS.len()) as u64;
    let blocks = if is_asynchronous { setup.share(200, 2) * runs } else { 0 };
    let total = sweep(setup, NAME, blocks, |in_loop, block| {
        let run = Run::of(setup, block);
        match Asynchronous::new(setup, MODEL_TICKS[run.rate]) {
            Ok(model) => follow(model, in_loop, run),
            Err(broken) => Tally { broken: Some(broken), ..Tally::default() },
        }
    })?;
    match total.broken {
        Some(broken) => Err(broken),
        None => Ok(judge(&total, is_asynchronous)),
    }
}

/// Moves the hand of a run; the asynchronous model and the model in the loop get the same poses.
fn follow(mut model: Asynchronous, in_loop: &mut Subject<'_>, run: Run) -> Tally {
    let mut total = Tally { runs: 1, ..Tally::default() };
    let (mut felt, mut direct, mut has_direct) = (Felt::default(), Felt::default(), true);
    let mut here = AtRate::default();
    for tick in 0..LAPS * run.hand_ticks {
        let input = run.input(tick);
        let travel_m = run.position_m(tick + 1) - run.position_m(tick);
        let (force_n, used) = model.force_n(&input);
        total.answers += u64::from(used.is_some());
        match used {
            Some(Ok(set)) => total.bilateral += u64::from(set.has_field != 0),
            Some(Err(error)) => {
                total.refused += 1;
                total.first_refusal.get_or_insert_with(|| error.to_string());
            }
            None => {}
        }
        felt.take(force_n, travel_m);
        total.felt += u64::from(force_n != DVec3::ZERO);
        let pull_n = -force_n.dot(model.push);
        here.pull_n.offer(pull_n, input.pose);
        here.pulling_ticks += u64::from(pull_n > ROUNDING_N);
        match in_loop.advance(input.pose, input.twist, PERIOD_NS) {
            Ok(output) if output.status() != Some(StepStatus::OutOfDomain) => {
                direct.take(output.wrench.force(), travel_m);
            }
            _ => has_direct = false,
        }
    }
    (here.given_j, here.step_n) = (felt.given_j, felt.step_n);
    if has_direct {
        (here.given_in_loop_j, here.step_in_loop_n) = (direct.given_j, direct.step_n);
        here.beyond_j = felt.given_j - RATIO * direct.given_j.max(0.0);
    }
    (total.unanswered, total.slowest_s) = (model.unanswered, model.slowest_s);
    total.by_rate[run.rate] = here;
    total
}

fn judge(total: &Tally, is_asynchronous: bool) -> Measure {
    let rates = total.by_rate.iter();
    let worst = rates
        .clone()
        .map(|rate| rate.pull_n)
        .fold(Worst::default(), |worst, pull_n| if pull_n.value > worst.value { pull_n } else { worst });
    // A field that pulls may be meant to.
    let limit_n = if total.bilateral > 0 { f64::INFINITY } else { ROUNDING_N };
    let comment = match total.bilateral {
        0 => "contacts only push",
        _ => "a local linear model continues through zero where the handle leaves; contacts do not",
    };
    let measure = Measure::of(["M11", NAME, "N"], &worst, [ROUNDING_N, limit_n], comment);
    let beyond_j = rates.map(|rate| rate.beyond_j).fold(0.0, f64::max);
    let measure = match (&total.first_refusal, measure.verdict) {
        (Some(refusal), _) => {
            let comment = format!("{} sets of contacts are refused, the first: {refusal}", total.refused);
            Measure { verdict: Verdict::Fail, comment, ..measure }
        }
        (None, Verdict::Pass) if beyond_j > NOTED_J => {
            let comment = format!("gives the hand {:.3} mJ more than in the loop", 1.0e3 * beyond_j);
            Measure { verdict: Verdict::Note, comment, ..measure }
        }
        _ => measure,
    };
    let mut measure = measure
        .count("runs", total.runs)
        .count("ticks with a force", total.felt)
        .count("answers", total.answers)
        .count("calls without answer", total.unanswered)
        .count("refused sets", total.refused)
        .with("slowest answer", 1.0e3 * total.slowest_s, "ms");
    for (rate, ticks) in total.by_rate.iter().zip(MODEL_TICKS) {
        let period_s = ticks as f64 * PERIOD_S;
        // An answer is used from the end of the period in which it is ready to the end of the next.
        let oldest_s = ((total.slowest_s / period_s).ceil().max(1.0) + 1.0) * period_s;
        let at = |quantity: &str| format!("{quantity}, {:.0} Hz", 1.0 / period_s);
        measure = measure
            .with(at("pull"), rate.pull_n.value, "N")
            .count(at("ticks that pull"), rate.pulling_ticks)
            .with(at("energy given to the hand"), 1.0e3 * rate.given_j, "mJ")
            .with(at("energy given in the loop"), 1.0e3 * rate.given_in_loop_j, "mJ")
            .with(at("largest step"), rate.step_n, "N")
            .with(at("largest step in the loop"), rate.step_in_loop_n, "N")
            .with(at("oldest answer"), 1.0e3 * oldest_s, "ms");
    }
    let why = match is_asynchronous {
        true => "no line through home has a force",
        false => "the model offers neither contacts nor a local linear model",
    };
    measure.unless_empty(total.felt + total.refused, why)
}
