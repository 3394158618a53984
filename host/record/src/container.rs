//! The MCAP layer of reading: from the bytes of a file to the messages on our topics.
//!
//! Reads from front to back and never needs the index at the end, so that a file without an end is no special
//! case. A chunk counts only whole and with the right checksum. Nothing in a file can make it panic or allocate
//! without bound: a length is believed only as far as there are bytes.

use crate::schema::{ENCODING, Topic};
use mcap::McapError;
use mcap::read::ChunkReader;
use mcap::records::{MessageHeader, Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use std::collections::BTreeMap;
use std::io::{self, Read};

/// Longest record believed, bytes: a quarter of a second at 10 kHz is 2 MB, other tools' chunks are a few.
const LONGEST_RECORD_BYTES: usize = 32 << 20;

/// Bytes asked of the file at a time.
const READ_BYTES: usize = 64 << 10;

/// Opcode that no record has: room that the file system had set aside for a file and never filled.
const NEVER_WRITTEN: u8 = 0;

/// What keeps a file from being read on.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Damage {
    /// The system could not read it.
    #[error("{0}")]
    Io(#[from] io::Error),
    /// It is not well-formed MCAP, or a checksum is wrong.
    #[error("{0}")]
    Container(#[from] McapError),
    /// The records of a chunk do not fill it.
    #[error("the records of a chunk do not fill it")]
    Chunk,
    /// A message is not well-formed.
    #[error("a message on `{topic}` cannot be decoded: {cause}")]
    Message {
        /// Topic of the message.
        topic: &'static str,
        /// What is wrong with it.
        #[source]
        cause: prost::DecodeError,
    },
    /// A message lacks a part that every recording has.
    #[error("a message on `{topic}` lacks `{field}`")]
    Missing {
        /// Topic of the message.
        topic: &'static str,
        /// What it lacks.
        field: &'static str,
    },
    /// A tick has no pose.
    #[error("a tick has no pose of the same time on `/tf`")]
    NoPose,
    /// Ticks are missing.
    #[error("{missing} ticks are missing")]
    Gap {
        /// How many.
        missing: u32,
    },
}

/// A message on one of our topics.
pub(crate) struct TopicMessage {
    pub(crate) topic: Topic,
    pub(crate) sequence: u32,
    pub(crate) time_ns: u64,
    pub(crate) data: Vec<u8>,
}

/// The messages on our topics, in the order of the file.
pub(crate) struct Messages<R> {
    source: R,
    reader: LinearReader,
    /// Records read and not yet looked at.
    records: std::vec::IntoIter<Record<'static>>,
    schemas: BTreeMap<u16, String>,
    channels: BTreeMap<u16, Topic>,
    /// Where the file breaks off is its end.
    may_be_cut_off: bool,
}

impl<R: Read> Messages<R> {
    pub(crate) fn new(source: R, may_be_cut_off: bool) -> Self {
        let options = LinearReaderOptions::default()
            .with_emit_chunks(true)
            .with_validate_data_section_crc(true)
            .with_record_length_limit(LONGEST_RECORD_BYTES);
        Self {
            source,
            reader: LinearReader::new_with_options(options),
            records: Vec::new().into_iter(),
            schemas: BTreeMap::new(),
            channels: BTreeMap::new(),
            may_be_cut_off,
        }
    }

    /// The next message, or none at the end. After an error there is no more to be had.
    pub(crate) fn next(&mut self) -> Result<Option<TopicMessage>, Damage> {
        loop {
            for record in self.records.by_ref() {
                match record {
                    Record::Schema { header, .. } => {
                        self.schemas.insert(header.id, header.name);
                    }
                    Record::Channel(channel) => {
                        let schema = self.schemas.get(&channel.schema_id);
                        if let Some(topic) = known_topic(&channel, schema) {
                            self.channels.insert(channel.id, topic);
                        }
                    }
                    Record::Message {
                        header: MessageHeader { channel_id, sequence, log_time, .. },
                        data,
                    } => {
                        if let Some(&topic) = self.channels.get(&channel_id) {
                            let data = data.into_owned();
                            return Ok(Some(TopicMessage { topic, sequence, time_ns: log_time, data }));
                        }
                    }
                    _ => {}
                }
            }
            match self.read_records()? {
                Some(records) => self.records = records.into_iter(),
                None => return Ok(None),
            }
        }
    }

    /// The records of the next chunk (or the next record outside of chunks), or none at the end of the data.
    fn read_records(&mut self) -> Result<Option<Vec<Record<'static>>>, Damage> {
        loop {
            match self.reader.next_event() {
                None => return Ok(None),
                Some(Err(McapError::UnexpectedEof)) if self.may_be_cut_off => return Ok(None),
                Some(Err(error)) => return Err(error.into()),
                Some(Ok(LinearReadEvent::ReadRequest(_))) => {
                    let bytes = read(&mut self.source, self.reader.insert(READ_BYTES))?;
                    self.reader.notify_read(bytes);
                }
                Some(Ok(LinearReadEvent::Record { opcode, data })) => match opcode {
                    op::CHUNK => return records_of_chunk(data).map(Some),
                    op::SCHEMA | op::CHANNEL | op::MESSAGE => {
                        return Ok(Some(vec![mcap::parse_record(opcode, data)?.into_owned()]));
                    }
                    op::DATA_END | op::FOOTER => return Ok(None),
                    NEVER_WRITTEN if self.may_be_cut_off => return Ok(None),
                    _ => {}
                },
            }
        }
    }
}

/// The topic of a channel, if it is one of ours in name and kind.
fn known_topic(channel: &mcap::records::Channel, schema: Option<&String>) -> Option<Topic> {
    let same = |topic: &Topic| {
        channel.topic == topic.name()
            && channel.message_encoding == ENCODING
            && schema.is_some_and(|name| name == topic.schema())
    };
    Topic::ALL.into_iter().find(same)
}

/// All records of a chunk, checked against its checksum.
fn records_of_chunk(chunk: &[u8]) -> Result<Vec<Record<'static>>, Damage> {
    let Record::Chunk { header, data } = mcap::parse_record(op::CHUNK, chunk)? else {
        return Err(Damage::Chunk);
    };
    if header.compression.is_empty() && !is_filled_by_records(&data) {
        return Err(Damage::Chunk);
    }
    let records = ChunkReader::new(header, &data)?.map(|record| Ok(record?.into_owned()));
    records.collect::<Result<_, McapError>>().map_err(Damage::from)
}

/// True if the bytes of a chunk are records a chunk may hold, end to end. `mcap` 0.26 trusts lengths inside a chunk.
fn is_filled_by_records(mut bytes: &[u8]) -> bool {
    while let Some(([opcode, length @ ..], rest)) = bytes.split_first_chunk::<9>() {
        let allowed = matches!(*opcode, op::SCHEMA | op::CHANNEL | op::MESSAGE);
        let length = usize::try_from(u64::from_le_bytes(*length)).ok();
        match length.and_then(|length| rest.split_at_checked(length)) {
            Some((_, next)) if allowed => bytes = next,
            _ => return false,
        }
    }
    bytes.is_empty()
}

/// Reads some bytes; 0 at the end of the file.
fn read(source: &mut impl Read, space: &mut [u8]) -> io::Result<usize> {
    loop {
        match source.read(space) {
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            other => return other,
        }
    }
}
