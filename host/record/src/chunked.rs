//! MCAP layer of the writer: messages in complete chunks, and an index of the chunks at the end.
//!
//! `mcap::Writer` stores the index in memory until the end, some 5 GB after 1 000 hours. This writer stores it in an unnamed
//! file beside the recording, so that memory does not grow.

use crate::file::NewFile;
use binrw::BinWrite;
use mcap::MAGIC;
use mcap::records::{
    Channel, ChunkHeader, ChunkIndex, DataEnd, Header, MessageHeader, MessageIndex, MessageIndexEntry,
    Metadata, MetadataIndex, SchemaHeader, Statistics, SummaryOffset, op,
};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufReader, BufWriter, Cursor, Read, Seek, SeekFrom, Write};
use std::path::Path;

/// Block size for copying the index, bytes.
const BLOCK_BYTES: usize = 64 << 10;

/// MCAP file that is written sequentially. Dropping it without [`ChunkedFile::finish`] also completes the file.
pub(crate) struct ChunkedFile {
    sink: Checksummed,
    chunk: Chunk,
    /// Index records of the chunks written so far.
    index: BufWriter<File>,
    index_bytes: u64,
    /// Records that the summary repeats, by opcode in the order of the summary.
    repeated: [(u8, Vec<u8>); 3],
    statistics: Statistics,
    phase: Phase,
}

/// State of writing.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Phase {
    Open,
    /// Complete, or removed.
    Closed,
    /// A write failed: bytes may be missing, and nothing may follow.
    Failed,
}

impl ChunkedFile {
    /// Writes the start of an MCAP file; `path` is used for the folder of the temporary index file.
    ///
    /// # Errors
    /// Errors of the system, if the file cannot be written to, or no file for the index can be created.
    pub(crate) fn create(file: NewFile, path: &Path, library: String) -> io::Result<Self> {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        let index =
            tempfile::tempfile_in(folder.unwrap_or(Path::new("."))).or_else(|_| tempfile::tempfile())?;
        let mut chunked = Self {
            sink: Checksummed { file, bytes: 0, checksum: crc32fast::Hasher::new() },
            chunk: Chunk::default(),
            index: BufWriter::new(index),
            index_bytes: 0,
            repeated: [op::SCHEMA, op::CHANNEL, op::METADATA_INDEX].map(|opcode| (opcode, Vec::new())),
            statistics: Statistics::default(),
            phase: Phase::Open,
        };
        chunked.sink.write_all(MAGIC)?;
        chunked.write_record(op::HEADER, &Header { profile: String::new(), library })?;
        Ok(chunked)
    }

    /// Writes a metadata record, and adds it to the summary.
    pub(crate) fn add_metadata(&mut self, metadata: &Metadata) -> io::Result<()> {
        let offset = self.sink.bytes;
        self.write_record(op::METADATA, metadata)?;
        self.statistics.metadata_count += 1;
        let length = self.sink.bytes - offset;
        let listed =
            encoded(op::METADATA_INDEX, &MetadataIndex { offset, length, name: metadata.name.clone() })?;
        self.repeat(op::METADATA_INDEX, &listed);
        Ok(())
    }

    /// Writes a schema, and repeats it in the summary.
    pub(crate) fn add_schema(&mut self, header: &SchemaHeader, data: &[u8]) -> io::Result<()> {
        let length = u32::try_from(data.len()).map_err(io::Error::other)?;
        let record = framed(op::SCHEMA, &[&little_endian(header)?, &length.to_le_bytes(), data]);
        self.statistics.schema_count += 1;
        self.repeat(op::SCHEMA, &record);
        self.emit(&record)
    }

    /// Writes a channel, and repeats it in the summary.
    pub(crate) fn add_channel(&mut self, channel: &Channel) -> io::Result<()> {
        let record = encoded(op::CHANNEL, channel)?;
        self.statistics.channel_count += 1;
        self.repeat(op::CHANNEL, &record);
        self.emit(&record)
    }

    /// Appends a message to the chunk in memory.
    pub(crate) fn write(&mut self, header: &MessageHeader, data: &[u8]) -> io::Result<()> {
        if self.phase == Phase::Failed {
            return Err(io::Error::other("an earlier write failed"));
        }
        let time_ns = header.log_time;
        let statistics = &mut self.statistics;
        if statistics.message_count == 0 {
            (statistics.message_start_time, statistics.message_end_time) = (time_ns, time_ns);
        }
        statistics.message_start_time = statistics.message_start_time.min(time_ns);
        statistics.message_end_time = statistics.message_end_time.max(time_ns);
        statistics.message_count += 1;
        *statistics.channel_message_counts.entry(header.channel_id).or_default() += 1;
        self.chunk.append(header, data)
    }

    /// Writes the chunk in memory with its message indexes to the file, and adds the chunk to the index.
    pub(crate) fn flush(&mut self) -> io::Result<()> {
        if self.chunk.messages.is_empty() {
            return self.flush_sink();
        }
        let (header, indexes) = self.chunk.described();
        let chunk_start_offset = self.sink.bytes;
        let messages = std::mem::take(&mut self.chunk.messages);
        let head = little_endian(&header)?;
        self.emit(&framed_head(op::CHUNK, head.len() + messages.len()))?;
        self.emit(&head)?;
        let written = self.emit(&messages);
        self.chunk.clear(messages);
        written?;
        let chunk_length = self.sink.bytes - chunk_start_offset;
        let mut message_index_offsets = BTreeMap::new();
        for index in indexes {
            message_index_offsets.insert(index.channel_id, self.sink.bytes);
            self.write_record(op::MESSAGE_INDEX, &index)?;
        }
        let listed = ChunkIndex {
            message_start_time: header.message_start_time,
            message_end_time: header.message_end_time,
            chunk_start_offset,
            chunk_length,
            message_index_offsets,
            message_index_length: self.sink.bytes - chunk_start_offset - chunk_length,
            compression: header.compression,
            compressed_size: header.compressed_size,
            uncompressed_size: header.uncompressed_size,
        };
        let listed = encoded(op::CHUNK_INDEX, &listed)?;
        let kept = self.index.write_all(&listed);
        self.attempt(kept)?;
        self.index_bytes += listed.len() as u64;
        self.statistics.chunk_count += 1;
        self.flush_sink()
    }

    /// Writes the last chunk and the summary, and closes the file; fails unless the file is still at the path, in full
    /// length.
    ///
    /// # Errors
    /// Errors of the system, or an error that wraps a [`FileError`](crate::FileError).
    pub(crate) fn finish(mut self, path: &Path) -> io::Result<()> {
        self.write_end()?;
        self.sink.file.close(path)
    }

    /// Removes the file, unless the path leads to another file by now.
    pub(crate) fn remove(mut self, path: &Path) {
        self.phase = Phase::Closed;
        self.sink.file.remove(path);
    }

    fn write_end(&mut self) -> io::Result<()> {
        self.flush()?;
        let data_section_crc = self.sink.checksum.clone().finalize();
        self.write_record(op::DATA_END, &DataEnd { data_section_crc })?;

        let summary_start = self.sink.bytes;
        self.sink.checksum = crc32fast::Hasher::new();
        let [schemas, channels, metadata] = std::mem::take(&mut self.repeated);
        let statistics = (op::STATISTICS, encoded(op::STATISTICS, &self.statistics)?);
        let mut groups = Vec::new();
        for (group_opcode, records) in [schemas, channels, statistics] {
            groups.push(self.write_group(group_opcode, |file| file.emit(&records))?);
        }
        groups.push(self.write_group(op::CHUNK_INDEX, Self::write_index)?);
        groups.push(self.write_group(metadata.0, |file| file.emit(&metadata.1))?);
        let summary_offset_start = self.sink.bytes;
        for group in groups.iter().filter(|group| group.group_length > 0) {
            self.write_record(op::SUMMARY_OFFSET, group)?;
        }

        // The checksum covers the part of the footer before it.
        let offsets = [summary_start, summary_offset_start].map(u64::to_le_bytes);
        self.emit(&framed_head(op::FOOTER, offsets.as_flattened().len() + size_of::<u32>()))?;
        self.emit(offsets.as_flattened())?;
        let summary_crc = self.sink.checksum.clone().finalize();
        self.emit(&summary_crc.to_le_bytes())?;
        self.emit(MAGIC)?;
        self.flush_sink()?;
        self.phase = Phase::Closed;
        Ok(())
    }

    fn write_group(
        &mut self,
        group_opcode: u8,
        write: impl FnOnce(&mut Self) -> io::Result<()>,
    ) -> io::Result<SummaryOffset> {
        let group_start = self.sink.bytes;
        write(self)?;
        Ok(SummaryOffset { group_opcode, group_start, group_length: self.sink.bytes - group_start })
    }

    /// Copies the index of the chunks to the file, a block at a time.
    fn write_index(&mut self) -> io::Result<()> {
        self.index.flush()?;
        let mut index = self.index.get_ref().try_clone()?;
        index.seek(SeekFrom::Start(0))?;
        let mut index = BufReader::with_capacity(BLOCK_BYTES, index).take(self.index_bytes);
        let copied = io::copy(&mut index, &mut self.sink);
        let copied = copied.and_then(|bytes| match bytes == self.index_bytes {
            true => Ok(()),
            false => Err(io::Error::from(io::ErrorKind::UnexpectedEof)),
        });
        self.attempt(copied)
    }

    fn repeat(&mut self, opcode: u8, record: &[u8]) {
        let group = self.repeated.iter_mut().find(|(group, _)| *group == opcode);
        group.into_iter().for_each(|(_, records)| records.extend_from_slice(record));
    }

    fn write_record(&mut self, opcode: u8, body: &impl for<'a> BinWrite<Args<'a> = ()>) -> io::Result<()> {
        let record = encoded(opcode, body)?;
        self.emit(&record)
    }

    fn emit(&mut self, bytes: &[u8]) -> io::Result<()> {
        if self.phase == Phase::Failed {
            return Err(io::Error::other("an earlier write failed"));
        }
        let written = self.sink.write_all(bytes);
        self.attempt(written)
    }

    fn flush_sink(&mut self) -> io::Result<()> {
        let flushed = self.sink.flush();
        self.attempt(flushed)
    }

    /// Returns a result unchanged; after an error nothing more is written.
    fn attempt(&mut self, result: io::Result<()>) -> io::Result<()> {
        if result.is_err() {
            self.phase = Phase::Failed;
        }
        result
    }
}

impl Drop for ChunkedFile {
    fn drop(&mut self) {
        if self.phase == Phase::Open {
            let _ = self.write_end();
        }
    }
}

/// Encoded messages of a chunk, and their offsets by channel.
#[derive(Default)]
struct Chunk {
    messages: Vec<u8>,
    places: BTreeMap<u16, Vec<MessageIndexEntry>>,
    first_ns: u64,
    last_ns: u64,
}

impl Chunk {
    fn append(&mut self, header: &MessageHeader, data: &[u8]) -> io::Result<()> {
        let time_ns = header.log_time;
        if self.messages.is_empty() {
            (self.first_ns, self.last_ns) = (time_ns, time_ns);
        }
        self.first_ns = self.first_ns.min(time_ns);
        self.last_ns = self.last_ns.max(time_ns);
        let offset = self.messages.len() as u64;
        let place = MessageIndexEntry { log_time: time_ns, offset };
        self.places.entry(header.channel_id).or_default().push(place);
        let head = little_endian(header)?;
        self.messages.extend_from_slice(&framed_head(op::MESSAGE, head.len() + data.len()));
        self.messages.extend_from_slice(&head);
        self.messages.extend_from_slice(data);
        Ok(())
    }

    /// Returns the header of the chunk, and the offsets of the messages of each channel.
    fn described(&mut self) -> (ChunkHeader, Vec<MessageIndex>) {
        let size = self.messages.len() as u64;
        let header = ChunkHeader {
            message_start_time: self.first_ns,
            message_end_time: self.last_ns,
            uncompressed_size: size,
            uncompressed_crc: crc32fast::hash(&self.messages),
            compression: String::new(),
            compressed_size: size,
        };
        let places = std::mem::take(&mut self.places).into_iter();
        (header, places.map(|(channel_id, records)| MessageIndex { channel_id, records }).collect())
    }

    /// Empties the chunk and reuses the memory of its messages.
    fn clear(&mut self, mut messages: Vec<u8>) {
        messages.clear();
        *self = Self { messages, ..Self::default() };
    }
}

/// File with the number of bytes written to it, and their checksum.
struct Checksummed {
    file: NewFile,
    bytes: u64,
    checksum: crc32fast::Hasher,
}

impl Write for Checksummed {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let count = self.file.write(bytes)?;
        self.checksum.update(&bytes[..count]);
        self.bytes += count as u64;
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

/// Encodes a value, little-endian.
fn little_endian<T: for<'a> BinWrite<Args<'a> = ()>>(value: &T) -> io::Result<Vec<u8>> {
    let mut bytes = Cursor::new(Vec::new());
    value.write_le(&mut bytes).map_err(io::Error::other)?;
    Ok(bytes.into_inner())
}

/// Encodes a record: opcode, length, body.
fn encoded<T: for<'a> BinWrite<Args<'a> = ()>>(opcode: u8, body: &T) -> io::Result<Vec<u8>> {
    Ok(framed(opcode, &[&little_endian(body)?]))
}

/// Returns a record from the parts of its body.
fn framed(opcode: u8, body: &[&[u8]]) -> Vec<u8> {
    let length = body.iter().map(|part| part.len()).sum();
    [&framed_head(opcode, length)[..], &body.concat()].concat()
}

/// Encodes opcode and length of a record.
fn framed_head(opcode: u8, length: usize) -> [u8; 9] {
    let mut head = [opcode; 9];
    head[1..].copy_from_slice(&(length as u64).to_le_bytes());
    head
}
