//! Reader of recordings: the description of the run, then the ticks one by one, bit by bit as recorded.

use crate::schema::{
    Change as ChangeMessage, ENCODING, FORMAT, FrameTransform, Log, Missing, Run, Tick, Topic,
};
use crate::{Note, RunDescription};
use flotor_core::Change;
use flotor_core::trace::TickRecord;
use flotor_hal::Pose;
use flotor_mcap::{ChannelInfo, Ending, Message, MessageReader, OpenError};
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

/// Suffix of the library name in the header of a repaired file.
pub(crate) const REPAIRED: &str = " (repaired)";

/// Damage that prevents further reading of a recording.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Damage {
    /// The structure of the MCAP file is damaged.
    #[error("{0}")]
    File(#[from] flotor_mcap::Damage),
    /// A message cannot be decoded.
    #[error("a message on `{topic}` cannot be decoded: {cause}")]
    Message {
        /// Topic of the message.
        topic: &'static str,
        /// Error of the decoder.
        #[source]
        cause: prost::DecodeError,
    },
    /// A message lacks a field that every recording has.
    #[error("a message on `{topic}` has no valid `{field}`")]
    Missing {
        /// Topic of the message.
        topic: &'static str,
        /// Name of the missing field.
        field: &'static str,
    },
    /// A tick has no pose.
    #[error("a tick has no pose of the same time on `/tf`")]
    NoPose,
    /// Number of tick records that are missing from the sequence.
    #[error("{}", gap(*.0))]
    Gap(u32),
}

/// Error of opening or reading a recording.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// The file cannot be opened.
    #[error("cannot open the recording `{}`: {cause}; check the path and its permissions", path.display())]
    Open {
        /// Path of the file.
        path: PathBuf,
        /// Error of the system.
        #[source]
        cause: io::Error,
    },
    /// The file has another format.
    #[error("`{}` is not an MCAP file; make a recording with `flotor run --record FILE.mcap`", .0.display())]
    NotMcap(PathBuf),
    /// The file is MCAP, but no recording of a run.
    #[error(
        "`{}` is an MCAP file, but not a recording of a run: its first message is not on `/flotor/run`; make a \
         recording with `flotor run --record FILE.mcap`",
        .0.display()
    )]
    NotARecording(PathBuf),
    /// The file is truncated before the end of the run description.
    #[error("`{}` is truncated before the run description and cannot be used; record again", .0.display())]
    CutOffAtStart(PathBuf),
    /// A later version wrote the file.
    #[error(
        "`{}` has format {format}, written by flotor {flotor_version}; this version reads formats up to {FORMAT}: update flotor",
        path.display()
    )]
    TooNew {
        /// Path of the file.
        path: PathBuf,
        /// Format of the file.
        format: u32,
        /// Version of the program that wrote it.
        flotor_version: String,
    },
    /// The file is compressed, which no writer of this crate does.
    #[error(
        "`{}` is compressed with `{compression}`; make a readable copy with `mcap decompress`",
        path.display()
    )]
    Compressed {
        /// Path of the file.
        path: PathBuf,
        /// Name of the compression.
        compression: String,
    },
    /// The file is damaged, and cannot be read any further.
    #[error("`{}` is damaged {}: {cause}; {}",
        path.display(),
        after_tick.map_or_else(|| "before its first tick".to_owned(), |tick| format!("after tick {tick}")),
        match (after_tick, cause) {
            (None, _) => "the recording contains no readable tick: record again",
            (_, Damage::File(_)) => "the ticks before the damage are intact: `flotor repair` copies them to a new file",
            _ => "the ticks before the damage are intact; for the others, record again",
        })]
    Damaged {
        /// Path of the file.
        path: PathBuf,
        /// Last good tick; `None` before the first one.
        after_tick: Option<u64>,
        /// Damage that was found.
        #[source]
        cause: Damage,
    },
}

/// Reader of a recording: an iterator over its ticks, which ends after an error.
pub struct Recording {
    path: PathBuf,
    messages: MessageReader<File, Topic>,
    run: RunDescription,
    notes: Vec<Note>,
    /// Changes before the last tick read, not returned yet.
    changes: Vec<Change>,
    /// Time and pose of the last pose message.
    pose: Option<(u64, Pose)>,
    /// Sequence number that the next tick must have.
    sequence: u32,
    last_tick: Option<u64>,
    is_over: bool,
}

impl Recording {
    /// Opens a recording and reads the description of the run. Not real-time.
    ///
    /// # Errors
    /// If the file cannot be opened, is not a recording, is compressed, has a later format, or is truncated or damaged
    /// before the end of the run description.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        let unreadable = |cause: io::Error| match cause.kind() {
            io::ErrorKind::InvalidInput => ReadError::NotMcap(path.into()),
            _ => ReadError::Open { path: path.into(), cause },
        };
        let file = flotor_hal::open_file(path).map_err(unreadable)?;
        let mut messages = MessageReader::open(file, known_topic).map_err(|error| match error {
            OpenError::Io(cause) => unreadable(cause),
            _ => ReadError::NotMcap(path.into()),
        })?;
        let ending = messages.ending();
        let first = messages.next_message().map_err(|cause| damaged(path, None, cause.into()))?;
        let run = match first {
            Some(first) if first.topic == Topic::Run => read_run(path, &first)?,
            None if ending == Ending::CutOff => return Err(ReadError::CutOffAtStart(path.into())),
            _ => return Err(ReadError::NotARecording(path.into())),
        };
        Ok(Self {
            path: path.into(),
            messages,
            run,
            notes: Vec::new(),
            changes: Vec::new(),
            pose: None,
            sequence: 0,
            last_tick: None,
            is_over: false,
        })
    }

    /// Returns the description of the run.
    #[must_use]
    pub fn run(&self) -> &RunDescription {
        &self.run
    }

    /// Returns the ending of the recording, finished or cut off, known since [`Self::open`]; a repaired recording
    /// counts as cut off.
    #[must_use]
    pub fn ending(&self) -> Ending {
        if self.is_repaired() { Ending::CutOff } else { self.messages.ending() }
    }

    /// Returns true if the file itself is complete, also after a repair.
    pub(crate) fn has_end(&self) -> bool {
        self.messages.ending() == Ending::Finished
    }

    /// Returns true if [`repair`](crate::repair) made the file from a truncated one.
    #[must_use]
    pub fn is_repaired(&self) -> bool {
        self.messages.library().ends_with(REPAIRED)
    }

    /// Returns the next message as it is stored, except the description of the run.
    pub(crate) fn next_message(&mut self) -> Result<Option<Message<Topic>>, Damage> {
        while let Some(message) = self.messages.next_message()? {
            if message.topic != Topic::Run {
                return Ok(Some(message));
            }
        }
        Ok(None)
    }

    /// Returns the notes up to the last tick read.
    #[must_use]
    pub fn notes(&self) -> &[Note] {
        &self.notes
    }

    /// Removes and returns the changes up to the last tick read, oldest first.
    pub fn take_changes(&mut self) -> Vec<Change> {
        std::mem::take(&mut self.changes)
    }

    fn next_tick(&mut self) -> Result<Option<TickRecord>, Damage> {
        while let Some(message) = self.messages.next_message()? {
            match message.topic {
                Topic::Run => {} // another recording appended to this one; its first tick is a gap
                Topic::Pose => {
                    let pose = decode::<FrameTransform>(&message)?.pose();
                    self.pose = Some((message.time_ns, pose.map_err(|part| lacks(&message, part))?));
                }
                Topic::Tick => return self.tick(&message).map(Some),
                Topic::Change => {
                    let change = decode::<ChangeMessage>(&message)?.change(message.time_ns);
                    self.changes.push(change.map_err(|part| lacks(&message, part))?);
                }
                Topic::Log => self.notes.push(decode::<Log>(&message)?.note(message.time_ns)),
            }
        }
        Ok(None)
    }

    fn tick(&mut self, message: &Message<Topic>) -> Result<TickRecord, Damage> {
        match message.sequence.wrapping_sub(self.sequence) {
            0 => self.sequence = self.sequence.wrapping_add(1),
            missing => return Err(Damage::Gap(missing)),
        }
        let pose = self.pose.take().filter(|(time_ns, _)| *time_ns == message.time_ns);
        let (_, pose) = pose.ok_or(Damage::NoPose)?;
        decode::<Tick>(message)?.record(pose).map_err(|part| lacks(message, part))
    }
}

impl Iterator for Recording {
    type Item = Result<TickRecord, ReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.is_over {
            return None;
        }
        match self.next_tick() {
            Ok(Some(record)) => {
                self.last_tick = Some(record.tick);
                Some(Ok(record))
            }
            end => {
                self.is_over = true;
                end.err().map(|cause| Err(damaged(&self.path, self.last_tick, cause)))
            }
        }
    }
}

impl std::iter::FusedIterator for Recording {}

/// Returns the topic of a channel with the name, schema and encoding of a recording's channel.
fn known_topic(channel: ChannelInfo<'_>) -> Option<Topic> {
    let matches = |topic: &Topic| channel.topic == topic.name() && channel.schema == topic.schema();
    Topic::ALL.into_iter().find(matches).filter(|_| channel.encoding == ENCODING)
}

fn read_run(path: &Path, message: &Message<Topic>) -> Result<RunDescription, ReadError> {
    let run = decode::<Run>(message).map_err(|cause| damaged(path, None, cause))?;
    if run.format > FORMAT {
        let Run { format, flotor_version, .. } = run;
        return Err(ReadError::TooNew { path: path.into(), format, flotor_version });
    }
    RunDescription::from_message(run).map_err(|part| damaged(path, None, lacks(message, part)))
}

fn decode<M: prost::Message + Default>(message: &Message<Topic>) -> Result<M, Damage> {
    let topic = message.topic.name();
    M::decode(message.data.as_slice()).map_err(|cause| Damage::Message { topic, cause })
}

/// Describes a gap of so many ticks; a number that wraps is a step back.
fn gap(missing: u32) -> String {
    match missing {
        1 => "a tick is missing".to_owned(),
        ..=0x7fff_ffff => format!("{missing} ticks are missing"),
        _ => "the tick numbers go back: ticks are repeated, or another recording is appended".to_owned(),
    }
}

fn lacks(message: &Message<Topic>, Missing(field): Missing) -> Damage {
    Damage::Missing { topic: message.topic.name(), field }
}

fn damaged(path: &Path, after_tick: Option<u64>, cause: Damage) -> ReadError {
    match cause {
        Damage::File(flotor_mcap::Damage::Compressed(compression)) => {
            ReadError::Compressed { path: path.into(), compression }
        }
        cause => ReadError::Damaged { path: path.into(), after_tick, cause },
    }
}
