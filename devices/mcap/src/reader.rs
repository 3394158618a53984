//! Sequential reader that never needs the index at the end, so that a truncated file is not a special case.
//! No file can make the reader panic or allocate without bound: lengths are checked against the available bytes and the
//! limit of a record.

use mcap::read::ChunkReader;
use mcap::records::{MessageHeader, Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{MAGIC, McapError};
use std::collections::BTreeMap;
use std::io::{self, Read, Seek, SeekFrom};

/// Length of the longest accepted record, bytes: a quarter of a second at 10 kHz has 2 MB, a chunk of other tools a few
/// MB.
const LONGEST_RECORD_BYTES: usize = 32 << 20;

/// Bytes requested from the file at a time.
const READ_BYTES: usize = 64 << 10;

/// Opcode 0, which no record has: space that the file system reserved for a file and never filled.
const NEVER_WRITTEN: u8 = 0;

/// Error of opening a file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OpenError {
    /// The system could not read the file.
    #[error("{0}")]
    Io(#[from] io::Error),
    /// The file has another format.
    #[error("not an MCAP file")]
    NotMcap,
}

/// Damage at which reading ends.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Damage {
    /// The system could not read the file.
    #[error("{0}")]
    Io(#[from] io::Error),
    /// The file is not well-formed MCAP, or a checksum is wrong.
    #[error("{0}")]
    Container(McapError),
    /// The file is compressed; only uncompressed chunks are read.
    #[error("the file is compressed with `{0}`; make a readable copy with `mcap decompress`")]
    Compressed(String),
    /// A chunk is not filled exactly by schemas, channels and messages.
    #[error("the records of a chunk do not fill the chunk exactly")]
    Chunk,
}

impl From<McapError> for Damage {
    fn from(error: McapError) -> Self {
        match error {
            McapError::UnsupportedCompression(compression) => Damage::Compressed(compression),
            error => Damage::Container(error),
        }
    }
}

/// Completeness of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// The writer finished the file; all messages are present.
    Finished,
    /// The file is truncated (a killed process, a full disk): its last messages are missing, from the first chunk that the
    /// writer had not yet written.
    CutOff,
}

/// Description of a channel.
#[derive(Clone, Copy, Debug)]
pub struct ChannelInfo<'a> {
    /// Topic of the channel.
    pub topic: &'a str,
    /// Encoding of the channel's messages.
    pub encoding: &'a str,
    /// Name of the messages' schema; empty without a schema.
    pub schema: &'a str,
}

/// Message on a chosen channel.
#[derive(Clone, Debug)]
pub struct Message<T> {
    /// Value that `choose` returned for the channel.
    pub topic: T,
    /// Sequence number given by the writer.
    pub sequence: u32,
    /// Log time of the message, ns.
    pub time_ns: u64,
    /// Message, in the encoding of the channel.
    pub data: Vec<u8>,
}

/// Reader of the messages of chosen channels, in the order of the file.
pub struct MessageReader<R, T> {
    source: R,
    reader: LinearReader,
    /// Records read and not yet returned.
    records: std::vec::IntoIter<Record<'static>>,
    choose: fn(ChannelInfo<'_>) -> Option<T>,
    schemas: BTreeMap<u16, String>,
    channels: BTreeMap<u16, T>,
    ending: Ending,
    library: String,
}

impl<R: Read + Seek, T: Copy> MessageReader<R, T> {
    /// Opens a file for the messages of all channels for which `choose` returns a value. Not real-time.
    ///
    /// # Errors
    /// [`OpenError`]: the file cannot be read, or does not begin with the magic bytes.
    pub fn open(mut source: R, choose: fn(ChannelInfo<'_>) -> Option<T>) -> Result<Self, OpenError> {
        if !begins_as_mcap(&mut source)? {
            return Err(OpenError::NotMcap);
        }
        let ending = find_ending(&mut source)?;
        source.rewind()?;
        let options = LinearReaderOptions::default()
            .with_emit_chunks(true)
            .with_validate_data_section_crc(true)
            .with_record_length_limit(LONGEST_RECORD_BYTES);
        Ok(Self {
            source,
            reader: LinearReader::new_with_options(options),
            records: Vec::new().into_iter(),
            choose,
            schemas: BTreeMap::new(),
            channels: BTreeMap::new(),
            ending,
            library: String::new(),
        })
    }

    /// Returns the name of the library that wrote the file; empty before the first call of [`Self::next_message`].
    #[must_use]
    pub fn library(&self) -> &str {
        &self.library
    }

    /// Returns the completeness of the file, determined by [`Self::open`].
    #[must_use]
    pub fn ending(&self) -> Ending {
        self.ending
    }

    /// Returns the next message; `None` at the end of the data. Do not call again after an error. Not real-time.
    ///
    /// # Errors
    /// [`Damage`] at the current position.
    pub fn next_message(&mut self) -> Result<Option<Message<T>>, Damage> {
        loop {
            for record in self.records.by_ref() {
                match record {
                    Record::Schema { header, .. } => {
                        self.schemas.insert(header.id, header.name);
                    }
                    Record::Channel(channel) => {
                        let info = ChannelInfo {
                            topic: &channel.topic,
                            encoding: &channel.message_encoding,
                            schema: self.schemas.get(&channel.schema_id).map_or("", String::as_str),
                        };
                        if let Some(topic) = (self.choose)(info) {
                            self.channels.insert(channel.id, topic);
                        }
                    }
                    Record::Message {
                        header: MessageHeader { channel_id, sequence, log_time: time_ns, .. },
                        data,
                    } => {
                        if let Some(&topic) = self.channels.get(&channel_id) {
                            return Ok(Some(Message { topic, sequence, time_ns, data: data.into_owned() }));
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

    /// Returns the records of the next chunk, or the next record outside of chunks; `None` at the end of the data.
    fn read_records(&mut self) -> Result<Option<Vec<Record<'static>>>, Damage> {
        let may_be_cut_off = self.ending == Ending::CutOff;
        loop {
            match self.reader.next_event() {
                None => return Ok(None),
                Some(Err(McapError::UnexpectedEof)) if may_be_cut_off => return Ok(None),
                Some(Err(error)) => return Err(error.into()),
                Some(Ok(LinearReadEvent::ReadRequest(_))) => {
                    let bytes = read(&mut self.source, self.reader.insert(READ_BYTES))?;
                    self.reader.notify_read(bytes);
                }
                Some(Ok(LinearReadEvent::Record { opcode, data })) => match opcode {
                    op::HEADER => {
                        if let Record::Header(header) = mcap::parse_record(opcode, data)? {
                            self.library = header.library;
                        }
                    }
                    op::CHUNK => return records_of_chunk(data).map(Some),
                    op::SCHEMA | op::CHANNEL | op::MESSAGE => {
                        return Ok(Some(vec![mcap::parse_record(opcode, data)?.into_owned()]));
                    }
                    op::DATA_END | op::FOOTER => return Ok(None),
                    NEVER_WRITTEN if may_be_cut_off => return Ok(None),
                    _ => {}
                },
            }
        }
    }
}

/// Returns true if the file begins with the magic bytes, or with a part of them and nothing else.
fn begins_as_mcap(source: &mut impl Read) -> io::Result<bool> {
    let mut head = Vec::with_capacity(MAGIC.len());
    source.take(MAGIC.len() as u64).read_to_end(&mut head)?;
    Ok(MAGIC.starts_with(&head))
}

/// Determines the completeness of a file: a finished one ends with the magic bytes.
fn find_ending(source: &mut (impl Read + Seek)) -> io::Result<Ending> {
    let length = source.seek(SeekFrom::End(0))?;
    let magic_length = MAGIC.len() as u64;
    if length < 2 * magic_length {
        return Ok(Ending::CutOff);
    }
    source.seek(SeekFrom::Start(length - magic_length))?;
    let mut tail = Vec::with_capacity(MAGIC.len());
    source.take(magic_length).read_to_end(&mut tail)?;
    Ok(if tail == MAGIC { Ending::Finished } else { Ending::CutOff })
}

/// Returns all records of a chunk, checked against its checksum.
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

/// Returns true if a chunk consists of permitted records, end to end. `mcap` 0.26 trusts lengths inside a chunk.
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
