//! Writer of recordings: writes a complete chunk at a time, at least every quarter of a second.

use crate::chunked::ChunkedFile;
use crate::file::{FileError, NewFile};
use crate::reader::REPAIRED;
use crate::schema::{Change as ChangeMessage, DESCRIPTOR_SET, ENCODING, FrameTransform, Log, Tick, Topic};
use crate::{Note, RunDescription};
use flotor_core::Change;
use flotor_core::trace::{Events, TickRecord};
use flotor_mcap::Message as StoredMessage;
use mcap::records::{Channel, MessageHeader, Metadata, SchemaHeader};
use prost::Message;
use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};

/// Largest recorded time that a killed process may lose, ns.
const CHUNK_NS: u64 = 250_000_000;

/// Name of the metadata record with the run's description.
const RUN_METADATA: &str = "flotor.run";

/// Key of the tick channel's metadata that names the bits of `events`, lowest first.
const EVENT_BITS: &str = "events";

/// Error of creating or writing a recording.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecordError {
    /// A file of that name exists: recordings are never overwritten.
    #[error(
        "the recording `{}` exists already, and recordings are not overwritten; name another file, or remove the recording",
        .0.display()
    )]
    Exists(PathBuf),
    /// The file could not be created.
    #[error("cannot make the recording `{}`: {cause}; name a file in a folder you may write to", path.display())]
    Create {
        /// Path of the file.
        path: PathBuf,
        /// Error of the system.
        #[source]
        cause: io::Error,
    },
    /// The file could not be written to.
    #[error(
        "cannot write the recording `{}`: {cause}; ticks written before are readable; make room or name another file, \
         and try again",
        path.display()
    )]
    Write {
        /// Path of the file.
        path: PathBuf,
        /// Error of the system.
        #[source]
        cause: io::Error,
    },
    /// Another program removed or replaced the file, or changed its length, during the run.
    #[error("the recording `{}` is lost or damaged: {damage}; try again", path.display())]
    Lost {
        /// Path of the file.
        path: PathBuf,
        /// Detected change of the file.
        #[source]
        damage: FileError,
    },
}

/// Writer of a recording.
///
/// Dropped without [`Recorder::finish`], the writer still completes the file, but reports no errors.
pub struct Recorder {
    path: PathBuf,
    file: ChunkedFile,
    /// Pose message of each device, filled anew for each tick.
    poses: Vec<FrameTransform>,
    /// Buffer of one encoded message, reused.
    buffer: Vec<u8>,
    /// Sequence number of the next tick in the file: a gap shows a reader that ticks are missing.
    sequence: u32,
    /// Time of the first tick that is not yet in the file.
    chunk_start_ns: Option<u64>,
}

impl Recorder {
    /// Creates the file and writes the description of the run to it. Not real-time.
    ///
    /// # Errors
    /// If the file exists, or cannot be created or written to.
    pub fn create(path: &Path, run: &RunDescription) -> Result<Self, RecordError> {
        Self::begin(path, new_file(path)?, run, "")
    }

    /// Creates the file of a repaired recording. Not real-time.
    ///
    /// # Errors
    /// Those of [`Self::create`].
    pub(crate) fn create_repaired(path: &Path, run: &RunDescription) -> Result<Self, RecordError> {
        Self::begin(path, new_file(path)?, run, REPAIRED)
    }

    /// Writes the start of the file; `suffix` is appended to the library name in its header.
    pub(crate) fn begin(
        path: &Path,
        file: NewFile,
        run: &RunDescription,
        suffix: &str,
    ) -> Result<Self, RecordError> {
        let library = format!("flotor/{}{suffix}", run.flotor_version);
        let file = write_head(path, file, run, library).map_err(|cause| write_error(path, cause))?;
        let names: Vec<&str> = run.devices().map(|device| device.name.as_str()).collect();
        let poses = match names.as_slice() {
            [] | [_] => vec![FrameTransform::of_handle()],
            several => several.iter().copied().map(FrameTransform::of_handle_at).collect(),
        };
        let mut recorder =
            Self { path: path.into(), file, poses, buffer: Vec::new(), sequence: 0, chunk_start_ns: None };
        recorder.write_now(Topic::Run, &run.to_message(), 0).map_err(|cause| write_error(path, cause))?;
        Ok(recorder)
    }

    /// Appends a tick. Not real-time: every quarter of a second it writes a chunk to the file.
    ///
    /// # Errors
    /// [`RecordError::Write`] or [`RecordError::Lost`], after which the recording is over: later calls fail too.
    pub fn record(&mut self, record: &TickRecord) -> Result<(), RecordError> {
        self.try_record(record).map_err(|cause| write_error(&self.path, cause))
    }

    /// Appends a change; call this before recording the first tick with the new value. Not real-time.
    ///
    /// # Errors
    /// [`RecordError::Write`], after which the recording is over: later calls fail too.
    pub fn change(&mut self, change: &Change) -> Result<(), RecordError> {
        // In the chunk with its tick: a file that lost the change has lost the tick too.
        encode(&ChangeMessage::new(change), &mut self.buffer)
            .and_then(|()| self.write(Topic::Change, change.time_ns))
            .map_err(|cause| write_error(&self.path, cause))
    }

    /// Appends a text event and writes it to the file at once. Not real-time.
    ///
    /// # Errors
    /// [`RecordError::Write`] or [`RecordError::Lost`], after which the recording is over: later calls fail too.
    pub fn note(&mut self, note: &Note) -> Result<(), RecordError> {
        // Notes are rare and explain why a run ended, so they are written at once.
        self.write_now(Topic::Log, &Log::new(note), note.time_ns)
            .map_err(|cause| write_error(&self.path, cause))
    }

    /// Appends a message of another recording unchanged. Not real-time: every quarter of a second it writes a chunk to the file.
    ///
    /// # Errors
    /// [`RecordError::Write`] or [`RecordError::Lost`].
    pub(crate) fn copy(&mut self, message: &StoredMessage<Topic>) -> Result<(), RecordError> {
        let StoredMessage { topic, sequence, time_ns, ref data } = *message;
        self.sequence = sequence;
        self.buffer.clear();
        self.buffer.extend_from_slice(data);
        let start_ns = *self.chunk_start_ns.get_or_insert(time_ns);
        let is_full = topic == Topic::Tick && time_ns.saturating_sub(start_ns) >= CHUNK_NS;
        let written = self.write(topic, time_ns).and_then(|()| if is_full { self.flush() } else { Ok(()) });
        written.map_err(|cause| write_error(&self.path, cause))
    }

    /// Writes the last chunk and the index, and closes the file. Not real-time.
    ///
    /// # Errors
    /// [`RecordError::Write`]: the index may be missing; chunks flushed before can be read. [`RecordError::Lost`]:
    /// another program changed the length of the file, or removed or replaced the file.
    pub fn finish(self) -> Result<(), RecordError> {
        let Self { path, file, .. } = self;
        file.finish(&path).map_err(|cause| write_error(&path, cause))
    }

    /// Closes the file and removes it, unless the path leads to another file by now. Not real-time.
    pub fn discard(self) {
        let Self { path, file, .. } = self;
        file.remove(&path);
    }

    fn try_record(&mut self, record: &TickRecord) -> io::Result<()> {
        // A device that the description lacks is recorded as the first, not lost.
        let device = usize::from(record.device).min(self.poses.len().saturating_sub(1));
        if let Some(pose) = self.poses.get_mut(device) {
            pose.set(record);
            encode(pose, &mut self.buffer)?;
            self.write(Topic::Pose, record.time_ns)?;
        }
        encode(&Tick::new(record), &mut self.buffer)?;
        self.write(Topic::Tick, record.time_ns)?;
        self.sequence = self.sequence.wrapping_add(1);

        let start_ns = *self.chunk_start_ns.get_or_insert(record.time_ns);
        // This tick lasts until the next: with a chunk closed one tick later, more time could be lost.
        let end_ns = record.time_ns.saturating_add(record.dt_ns);
        if end_ns.saturating_sub(start_ns) >= CHUNK_NS { self.flush() } else { Ok(()) }
    }

    fn write_now(&mut self, topic: Topic, message: &impl Message, time_ns: u64) -> io::Result<()> {
        encode(message, &mut self.buffer)?;
        self.write(topic, time_ns)?;
        self.flush()
    }

    /// Appends the message in the buffer to the chunk in memory.
    fn write(&mut self, topic: Topic, time_ns: u64) -> io::Result<()> {
        let header = MessageHeader {
            channel_id: topic.id(),
            sequence: self.sequence,
            log_time: time_ns,
            publish_time: time_ns,
        };
        self.file.write(&header, &self.buffer)
    }

    /// Writes the complete chunk to the file.
    fn flush(&mut self) -> io::Result<()> {
        self.chunk_start_ns = None;
        self.file.flush()
    }
}

fn new_file(path: &Path) -> Result<NewFile, RecordError> {
    NewFile::create(path).map_err(|cause| match cause.kind() {
        io::ErrorKind::AlreadyExists => RecordError::Exists(path.into()),
        _ => RecordError::Create { path: path.into(), cause },
    })
}

/// Writes the start of the file: header with the library name, metadata of the run, schemas and channels of all
/// messages.
fn write_head(path: &Path, file: NewFile, run: &RunDescription, library: String) -> io::Result<ChunkedFile> {
    let mut file = ChunkedFile::create(file, path, library)?;
    file.add_metadata(&Metadata { name: RUN_METADATA.to_owned(), metadata: run.to_metadata() })?;
    let event_bits = BTreeMap::from([(EVENT_BITS.to_owned(), Events::NAMES.join(" "))]);
    for topic in Topic::ALL {
        let id = topic.id();
        let schema = SchemaHeader { id, name: topic.schema().to_owned(), encoding: ENCODING.to_owned() };
        file.add_schema(&schema, DESCRIPTOR_SET)?;
        file.add_channel(&Channel {
            id,
            schema_id: id,
            topic: topic.name().to_owned(),
            message_encoding: ENCODING.to_owned(),
            metadata: if topic == Topic::Tick { event_bits.clone() } else { BTreeMap::new() },
        })?;
    }
    Ok(file)
}

/// Encodes a message into the emptied buffer.
fn encode(message: &impl Message, buffer: &mut Vec<u8>) -> io::Result<()> {
    buffer.clear();
    message.encode(buffer).map_err(io::Error::from)
}

fn write_error(path: &Path, cause: io::Error) -> RecordError {
    let path = path.to_path_buf();
    match cause.downcast::<FileError>() {
        Ok(damage) => RecordError::Lost { path, damage },
        Err(cause) => RecordError::Write { path, cause },
    }
}
