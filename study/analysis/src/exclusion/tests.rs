use super::*;
use flotor_study::kinematics::StimulusKinematics;
use flotor_study::procedure::{Procedure, QuestPlusRule};
use flotor_study::protocol::{Checks, JndProtocol, MagnitudeProtocol, ObviousPairs};
use flotor_study::sitting::Sitting;
use flotor_study::trial::{Exploration, Phase, Position, Presented};

fn number(number: u16) -> SubjectNumber {
    SubjectNumber::new(number).unwrap()
}

fn jnd() -> Protocol {
    let checks = Checks { catch: 1, repeats: 1, obvious: None };
    let mut jnd = JndProtocol { bases: vec![26.0], replications: 4, checks, ..JndProtocol::default() };
    jnd.demo.shown = false;
    Protocol::Jnd(jnd)
}

/// A sitting with answers and movements given by the trial.
fn sit(
    protocol: &Protocol,
    subject: u16,
    respond: impl Fn(&Trial) -> Response,
    time_s: impl Fn(&Trial) -> f64,
) -> SubjectRecord {
    let subject = number(subject);
    let mut sitting = Sitting::new(protocol, 1, subject);
    let mut trials = Vec::new();
    while let Some(trial) = sitting.next() {
        let felt = StimulusKinematics {
            duration_s: 1.0,
            mean_speed_m_per_s: 0.02,
            mean_acceleration_m_per_s2: 0.0,
            mean_force_n: 1.0,
            peak_force_n: 1.0,
            cycles: 1,
            felt_stiffness_n_per_m: None,
        };
        let exploration = Exploration {
            response_time_s: Some(time_s(&trial)),
            kinematics: vec![felt; trial.presented.values().len()],
            missed_ticks: u64::from(subject.get() == 3) * 200,
            ..Exploration::default()
        };
        let response = respond(&trial);
        let verdict = sitting.answer(response, &exploration).unwrap();
        trials.push(TrialEvent { trial, response, verdict, exploration });
    }
    let first_modality = protocol.first_modality().of(subject);
    SubjectRecord { subject, first_modality, trials, tracks: sitting.results().to_vec() }
}

/// Names the larger one if it is much larger; `trigger` says what of equal ones.
fn honest(trial: &Trial, of_equal: Response) -> Response {
    match trial.presented {
        Presented::One { value } => Response::Rating(value),
        Presented::Pair(pair) if pair.delta == 0.0 && trial.phase == Phase::Catch => of_equal,
        Presented::Pair(pair) if pair.delta < 0.1 => Response::DontKnow,
        Presented::Pair(pair) if pair.larger_at == Position::First => Response::First,
        Presented::Pair(_) => Response::Second,
    }
}

fn all(protocol: &Protocol) -> Vec<SubjectRecord> {
    let usual = |_: &Trial| 1.0;
    vec![
        sit(protocol, 1, |trial| honest(trial, Response::DontKnow), usual),
        sit(protocol, 2, |trial| honest(trial, Response::First), usual),
        sit(protocol, 3, |trial| honest(trial, Response::DontKnow), usual),
        sit(
            protocol,
            4,
            |trial| honest(trial, Response::DontKnow),
            |trial| {
                if trial.track == 2 && trial.phase == Phase::Main { 0.1 } else { 1.0 }
            },
        ),
    ]
}

/// Somebody with the keys the wrong way round has a threshold in every condition; what they are is said and can be excluded.
#[test]
fn who_answers_the_wrong_way_round_is_flagged_and_excluded() {
    let Protocol::Jnd(mut jnd) = jnd() else { unreachable!("a difference experiment") };
    jnd.procedure = Procedure::QuestPlus(QuestPlusRule { trials: 12, ..QuestPlusRule::default() });
    jnd.checks.obvious = Some(ObviousPairs { count: 1, delta: 0.6 });
    let protocol = Protocol::Jnd(jnd);
    let reversed = |trial: &Trial| match honest(trial, Response::First) {
        Response::First => Response::Second,
        Response::Second => Response::First,
        other => other,
    };
    let (usual, honest) = (|_: &Trial| 1.0, |trial: &Trial| honest(trial, Response::DontKnow));
    let records = vec![sit(&protocol, 1, honest, usual), sit(&protocol, 2, reversed, usual)];
    let flags = |record| crate::SubjectQuality::of(&protocol, record, &[]).flags.join("\n");
    let said = flags(&records[1]);
    for flag in [
        "wrong answers to differences of 40 % and more",
        "vh base 26: worse than chance: 24 of 24 wrong, binomial p < 0.001",
        "h base 26: no psychometric function fits",
        "tracks whose answers do not bound the threshold",
        "more than half of the obvious pairs were missed",
    ] {
        assert!(said.contains(flag), "{flag}: {said}");
    }
    let of_the_other = flags(&records[0]);
    assert!(!of_the_other.contains("wrong") && !of_the_other.contains("obvious"), "{of_the_other}");
    for rules in [
        ExclusionRules { most_wrong_at_large: Some(0.2), ..ExclusionRules::default() },
        ExclusionRules { most_missed_obvious: Some(0.5), ..ExclusionRules::default() },
    ] {
        rules.check(&protocol).unwrap();
        let applied = apply(&rules, &protocol, records.clone(), Estimator::Procedure, None);
        assert_eq!(applied.kept.len(), 1, "{rules:?}");
        let [exclusion] = applied.excluded.as_slice() else { panic!("{:?}", applied.excluded) };
        assert_eq!((exclusion.subject, exclusion.scope), (number(2), Scope::Sitting));
    }
}

#[test]
fn each_rule_excludes_what_it_names_and_nothing_else() {
    let protocol = jnd();
    let excluded = |rules: &ExclusionRules, estimator| {
        rules.check(&protocol).unwrap();
        apply(rules, &protocol, all(&protocol), estimator, Some(1000.0))
    };
    let none = excluded(&ExclusionRules::default(), Estimator::Procedure);
    assert_eq!((none.kept.len(), none.excluded.len()), (4, 0));
    for (rules, subject, rule) in [
        (
            ExclusionRules { most_false_alarms: Some(0.5), ..ExclusionRules::default() },
            2,
            "most_false_alarms",
        ),
        (
            ExclusionRules { most_missed_ticks: Some(0.05), ..ExclusionRules::default() },
            3,
            "most_missed_ticks",
        ),
    ] {
        let applied = excluded(&rules, Estimator::Procedure);
        let [Exclusion { subject: who, scope: Scope::Sitting, rule: by, .. }] = applied.excluded.as_slice()
        else {
            panic!("{:?}", applied.excluded)
        };
        assert_eq!((who.get(), *by, applied.kept.len()), (subject, rule, 3));
        assert!(applied.to_text(&rules).contains(&rules.text_of(rule)));
    }
    let times = ExclusionRules { response_time_s: Some([0.2, 20.0]), ..ExclusionRules::default() };
    let applied = excluded(&times, Estimator::Procedure);
    let [Exclusion { subject: who, scope: Scope::Track(2), .. }] = applied.excluded.as_slice() else {
        panic!("{:?}", applied.excluded)
    };
    let kept = applied.kept.iter().find(|record| record.subject == *who).unwrap();
    assert_eq!((who.get(), kept.tracks.len()), (4, 3));
    assert!(kept.counted().all(|event| event.trial.track != 2));
    let applied = excluded(&times, Estimator::Map);
    assert!(applied.excluded.len() > 5, "trial by trial: {:?}", applied.excluded);
    let few = ExclusionRules { most_excluded_trials: Some(0.1), ..times };
    let applied = excluded(&few, Estimator::Map);
    assert_eq!((applied.excluded.len(), applied.kept.len()), (1, 3), "{:?}", applied.excluded);
    let movement = ExclusionRules { least_movement_mm: Some(30.0), ..ExclusionRules::default() };
    let applied = excluded(&movement, Estimator::Procedure);
    assert_eq!(applied.kept.len(), 0, "nobody moved 30 mm");
    assert!(applied.excluded.iter().any(|exclusion| exclusion.rule == EMPTY_CONDITION));
}

/// A rule that could not be applied names those of whom something is not known, also where it took others.
#[test]
fn a_rule_that_is_not_applied_names_the_subjects() {
    let protocol = jnd();
    let mut records = all(&protocol);
    for record in &mut records[..2] {
        record.trials.iter_mut().for_each(|event| event.exploration.response_time_s = None);
    }
    let rules = ExclusionRules { response_time_s: Some([0.2, 20.0]), ..ExclusionRules::default() };
    let applied = apply(&rules, &protocol, records, Estimator::Procedure, None);
    let [one] = applied.not_applied.as_slice() else { panic!("{:?}", applied.not_applied) };
    assert_eq!(one.to_string(), "response_time_s: not measured for simulated observers (sub-01, sub-02)");
    assert!(applied.to_text(&rules).contains(&one.to_string()) && applied.excluded.len() == 1);
}

/// Who feels a pair again, and then for a short time only, has moved as far with each as both times together.
#[test]
fn feeling_again_adds_to_the_way() {
    let protocol = jnd();
    let rules = ExclusionRules { least_movement_mm: Some(15.0), ..ExclusionRules::default() };
    for (speeds, is_kept) in [
        (&[0.02, 0.02][..], true),
        (&[0.02, 0.01], false),
        (&[0.02, 0.01, 0.001, 0.008], true),
        (&[0.02, 0.01, 0.02, 0.001], false),
    ] {
        let mut record = all(&protocol).remove(0);
        for event in &mut record.trials {
            let one = event.exploration.kinematics.remove(0);
            let at = |speed: &f64| StimulusKinematics { mean_speed_m_per_s: *speed, ..one };
            event.exploration.kinematics = speeds.iter().map(at).collect();
        }
        let applied = apply(&rules, &protocol, vec![record], Estimator::Procedure, None);
        assert_eq!(applied.excluded.is_empty(), is_kept, "{speeds:?}: {:?}", applied.excluded);
    }
}

/// A sitting is compared by its thresholds: tracks without one do not make up for the track that a rule takes, and a sitting that never
/// had one in a condition takes no other away.
#[test]
fn a_condition_without_a_threshold_left_takes_the_sitting() {
    let protocol = jnd();
    let mut records = all(&protocol);
    let of_track = |record: &SubjectRecord| {
        record.tracks.iter().find(|track| track.track == 2).map(|track| track.modality)
    };
    let modality = of_track(&records[3]).unwrap();
    let others = records[3].tracks.iter_mut().filter(|track| track.track != 2 && track.modality == modality);
    others.for_each(|track| track.threshold = None);
    records[0].tracks.iter_mut().for_each(|track| track.threshold = None);
    let times = ExclusionRules { response_time_s: Some([0.2, 20.0]), ..ExclusionRules::default() };
    let applied = apply(&times, &protocol, records.clone(), Estimator::Procedure, None);
    let [never, _, Exclusion { subject, scope: Scope::Sitting, rule, found }] = applied.excluded.as_slice()
    else {
        panic!("{:?}", applied.excluded)
    };
    assert_eq!((never.subject.get(), never.scope, never.rule), (1, Scope::Sitting, EMPTY_CONDITION));
    assert_eq!((subject.get(), *rule, applied.kept.len()), (4, EMPTY_CONDITION, 2));
    assert_eq!(*found, format!("{} at 26: no track with a threshold", modality.word()));
    let applied = apply(&times, &protocol, records, Estimator::Map, None);
    assert_eq!(applied.kept.len(), 4, "all answers of the other track: {:?}", applied.excluded);
}

#[test]
fn rules_that_cannot_be_are_refused_with_their_name() {
    let magnitude = Protocol::Magnitude(MagnitudeProtocol::default());
    let none = ExclusionRules::default();
    for (protocol, rules, name) in [
        (jnd(), ExclusionRules { most_dont_know: Some(1.5), ..none.clone() }, "most_dont_know"),
        (jnd(), ExclusionRules { response_time_s: Some([3.0, 2.0]), ..none.clone() }, "response_time_s"),
        (
            jnd(),
            ExclusionRules { response_time_s: Some([0.2, f64::INFINITY]), ..none.clone() },
            "response_time_s",
        ),
        (jnd(), ExclusionRules { least_movement_mm: Some(f64::NAN), ..none.clone() }, "least_movement_mm"),
        (jnd(), ExclusionRules { most_excluded_trials: Some(0.5), ..none.clone() }, "most_excluded_trials"),
        (magnitude.clone(), ExclusionRules { most_false_alarms: Some(0.5), ..none.clone() }, "catch_trials"),
        (
            magnitude.clone(),
            ExclusionRules { most_retest_deviation: Some(0.5), ..none.clone() },
            "repeat_checks",
        ),
        (magnitude, ExclusionRules { most_dont_know: Some(0.5), ..none }, "most_dont_know"),
    ] {
        assert!(rules.check(&protocol).unwrap_err().contains(name), "{name}");
    }
}

/// Without answers that check anything nothing is said; with them, the shares are those that were answered.
#[test]
fn checks_are_counted_by_what_was_answered() {
    let records = all(&jnd());
    let checks: Vec<SubjectChecks> = records.iter().map(SubjectChecks::of).collect();
    assert_eq!(checks.iter().map(|one| one.catch_trials).collect::<Vec<_>>(), [4; 4]);
    assert_eq!(checks.iter().map(|one| one.false_alarms).collect::<Vec<_>>(), [0, 4, 0, 0]);
    assert!(checks.iter().all(|one| one.agreement == Some(1.0) && one.repeat_checks == 4), "{checks:?}");
    let magnitude = MagnitudeProtocol { repeat_checks: 2, ..MagnitudeProtocol::default() };
    let exact =
        sit(&Protocol::Magnitude(magnitude.clone()), 1, |trial| honest(trial, Response::DontKnow), |_| 1.0);
    assert_eq!(SubjectChecks::of(&exact).retest_deviation, Some(0.0));
    // Every second rating is larger by 2: deviation of a single one is 2 / sqrt(2) where the two differ.
    let rate = |trial: &Trial| match trial.presented {
        Presented::One { value } => {
            Response::Rating(value + f64::from(u8::from(trial.phase == Phase::RepeatCheck)) * 2.0)
        }
        Presented::Pair(_) => Response::DontKnow,
    };
    let one = SubjectChecks::of(&sit(&Protocol::Magnitude(magnitude), 1, rate, |_| 1.0));
    let expected = 2.0_f64.sqrt() / 30.0;
    assert!((one.retest_deviation.unwrap() - expected).abs() < 1.0e-12, "{one:?}");
}
