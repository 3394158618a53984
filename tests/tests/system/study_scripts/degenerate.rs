//! Studies whose answers do not vary where a test needs it: ties, all right, all wrong, all equal, two people.

use flotor_study::dataset::Dataset;
use flotor_study::log::{Begin, Event, FORMAT, TrialEvent};
use flotor_study::procedure::{Procedure, QuestPlusRule};
use flotor_study::protocol::{JndProtocol, MagnitudeProtocol, Protocol, SubjectNumber};
use flotor_study::trial::{Exploration, Modality, Phase, Position, Presented, Response, Trial};
use std::path::Path;

/// Answer of a subject to a trial: of a rating the stimulus, of a pair the place of the larger one.
type Answer = fn(f64, f64, Modality) -> Response;

/// A study: its name, its people, a line of its report, and the answers.
pub(super) struct Degenerate {
    pub(super) name: &'static str,
    pub(super) task: Task,
    pub(super) subjects: u16,
    pub(super) line: &'static str,
    answer: Answer,
}

#[derive(Clone, Copy)]
pub(super) enum Task {
    Pairs,
    Ratings,
}

const RIGHT: Answer = |_, larger_at, _| if larger_at == 1.0 { Response::First } else { Response::Second };
const WRONG: Answer = |_, larger_at, _| if larger_at == 1.0 { Response::Second } else { Response::First };

/// The softest stimulus of the ratings.
const SOFTEST: f64 = 12.0;

pub(super) const STUDIES: [Degenerate; 9] = [
    Degenerate {
        name: "all-right",
        task: Task::Pairs,
        subjects: 2,
        line: "difference not testable: no difference in any subject",
        answer: RIGHT,
    },
    Degenerate {
        name: "all-wrong",
        task: Task::Pairs,
        subjects: 2,
        line: "base not testable: no variation between subjects, which the test requires",
        answer: WRONG,
    },
    Degenerate {
        name: "all-unsure",
        task: Task::Pairs,
        subjects: 3,
        line: "fraction, base 26 - 17 not testable: no difference in any subject",
        answer: |_, _, _| Response::DontKnow,
    },
    Degenerate {
        name: "one-modality-right",
        task: Task::Pairs,
        subjects: 4,
        line: "difference not testable: the same difference in every subject",
        answer: |subject, larger_at, modality| match modality {
            Modality::Vh => RIGHT(subject, larger_at, modality),
            Modality::H => WRONG(subject, larger_at, modality),
        },
    },
    Degenerate {
        name: "all-five",
        task: Task::Ratings,
        subjects: 3,
        line: "Linear trend not testable: equal means at all levels",
        answer: |_, _, _| Response::Rating(5.0),
    },
    Degenerate {
        name: "two-alike",
        task: Task::Ratings,
        subjects: 2,
        line: "stimulus not testable: no variation between subjects, which the test requires",
        answer: |_, stimulus, _| Response::Rating(stimulus.sqrt()),
    },
    Degenerate {
        name: "softest-is-one",
        task: Task::Ratings,
        subjects: 12,
        line: "h - vh, stimulus 12 not testable: no difference in any subject",
        answer: |subject, stimulus, modality| {
            let own = 1.0 + 0.3 * (subject * 1.7 + stimulus).sin() + 0.1 * f64::from(modality as u8);
            Response::Rating(if stimulus == SOFTEST { 1.0 } else { (own * stimulus / 4.0).ceil() })
        },
    },
    Degenerate {
        name: "top-of-the-scale",
        task: Task::Ratings,
        subjects: 5,
        line: "h - vh, stimulus 48 not testable: no difference in any subject",
        answer: |subject, stimulus, modality| {
            let seen = (stimulus / 10.0 + subject.sin() + f64::from(modality as u8)).round();
            Response::Rating(if stimulus == 48.0 { 7.0 } else { seen.clamp(1.0, 7.0) })
        },
    },
    Degenerate {
        name: "one-higher-without-vision",
        task: Task::Ratings,
        subjects: 4,
        line: "modality not testable: no variation between subjects, which the test requires",
        answer: |_, stimulus, modality| Response::Rating(stimulus + f64::from(modality as u8)),
    },
];

impl Degenerate {
    fn protocol(&self) -> Protocol {
        match self.task {
            Task::Pairs => {
                let rule = QuestPlusRule { trials: 12, ..QuestPlusRule::default() };
                let mut jnd = JndProtocol {
                    replications: 2,
                    procedure: Procedure::QuestPlus(rule),
                    ..JndProtocol::default()
                };
                // Not the thesis's bases, so that nothing stands beside the numbers.
                jnd.bases = vec![17.0, 26.0, 36.0];
                jnd.demo.shown = false;
                Protocol::Jnd(jnd)
            }
            Task::Ratings => Protocol::Magnitude(MagnitudeProtocol {
                values: MagnitudeProtocol::evenly(SOFTEST, 48.0, 4),
                replications: 2,
                demo: 0,
                ..MagnitudeProtocol::default()
            }),
        }
    }

    /// Writes the logs of all sittings into a folder of this name.
    pub(super) fn write(&self, folder: &Path) {
        let dataset = Dataset::at(&folder.join(self.name));
        for subject in (1..=self.subjects).filter_map(SubjectNumber::new) {
            let begin = Begin {
                format: FORMAT,
                version: "0".to_owned(),
                subject,
                seed: 7,
                plan: None,
                protocol: self.protocol(),
                person: None,
                observer: serde_json::json!({ "human": "scripted" }),
                apparatus: serde_json::json!(null),
                inputs: Vec::new(),
            };
            let (mut sitting, mut log) = dataset.begin(begin).unwrap();
            while let Some(trial) = sitting.next() {
                assert_eq!(trial.phase, Phase::Main);
                let (response, exploration) = (self.respond(subject, &trial), Exploration::default());
                let verdict = sitting.answer(response, &exploration).unwrap();
                log.write(&Event::Trial(Box::new(TrialEvent { trial, response, verdict, exploration })))
                    .unwrap();
            }
            log.write(&Event::End { trials: sitting.presented() }).unwrap();
        }
    }

    fn respond(&self, subject: SubjectNumber, trial: &Trial) -> Response {
        let seen = match trial.presented {
            Presented::One { value } => value,
            Presented::Pair(pair) => f64::from(1 + u8::from(pair.larger_at == Position::Second)),
        };
        (self.answer)(f64::from(subject.get()), seen, trial.modality)
    }
}
