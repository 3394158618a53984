//! Parquet table of a sweep: the same rows give the same bytes with any executor.

use crate::design::Cell;
use crate::store::Store;
use crate::task::{Column, ColumnKind, Sweep};
use parquet::basic::{Compression, LogicalType, Repetition, Type as PhysicalType};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Error of writing a table.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TableError {
    /// Some tasks are not finished.
    #[error("{open} of {all} tasks are not finished; run the sweep again to resume")]
    Unfinished {
        /// Number of unfinished tasks.
        open: usize,
        /// Number of all tasks.
        all: usize,
    },
    /// The file cannot be written.
    #[error("{}: cannot write the table: {cause}; check free space and permissions", path.display())]
    File {
        /// Path of the file.
        path: PathBuf,
        /// Error of the system.
        cause: std::io::Error,
    },
    /// The Parquet writer failed.
    #[error("{}: cannot write the table: {cause}; check free space and permissions", path.display())]
    Parquet {
        /// Path of the table.
        path: PathBuf,
        /// Error of the writer.
        cause: ParquetError,
    },
}

/// Returns all rows of a finished sweep, in order.
///
/// # Errors
/// [`TableError::Unfinished`] with the number of unfinished tasks.
pub fn rows(sweep: &Sweep, store: &Store) -> Result<Vec<Vec<Cell>>, TableError> {
    let tasks = sweep.tasks();
    let blocks: Vec<Option<Vec<Vec<Cell>>>> = tasks.iter().map(|task| store.rows(task)).collect();
    let open = blocks.iter().filter(|block| block.is_none()).count();
    if open > 0 {
        return Err(TableError::Unfinished { open, all: tasks.len() });
    }
    Ok(blocks.into_iter().flatten().flatten().collect())
}

/// Rows per row group: few enough to read in pieces, enough for a negligible overhead.
const GROUP_ROWS: usize = 1 << 20;

/// Writes rows as an uncompressed Parquet file.
///
/// # Errors
/// [`TableError`] of the file or of the writer.
pub fn write(path: &Path, columns: &[Column], rows: &[Vec<Cell>]) -> Result<(), TableError> {
    let parquet = |cause| TableError::Parquet { path: path.into(), cause };
    // Write a temporary file and rename it: a reader never sees a partial table.
    let partial = path.with_extension("parquet.partial");
    let file = File::create(&partial).map_err(|cause| TableError::File { path: partial.clone(), cause })?;
    let schema = schema(columns).map_err(parquet)?;
    let properties = WriterProperties::builder()
        .set_created_by(format!("flotor {}", env!("CARGO_PKG_VERSION")))
        .set_compression(Compression::UNCOMPRESSED)
        .build();
    let mut writer = SerializedFileWriter::new(file, schema, Arc::new(properties)).map_err(parquet)?;
    for group in rows.chunks(GROUP_ROWS) {
        write_group(&mut writer, columns, group).map_err(parquet)?;
    }
    writer.close().map_err(parquet)?;
    std::fs::rename(&partial, path).map_err(|cause| TableError::File { path: path.into(), cause })
}

fn schema(columns: &[Column]) -> Result<Arc<Type>, ParquetError> {
    let field = |column: &Column| {
        let (physical, logical) = match column.kind {
            ColumnKind::Number => (PhysicalType::DOUBLE, None),
            ColumnKind::Word => (PhysicalType::BYTE_ARRAY, Some(LogicalType::String)),
        };
        let builder = Type::primitive_type_builder(&column.name, physical);
        builder.with_repetition(Repetition::REQUIRED).with_logical_type(logical).build().map(Arc::new)
    };
    let fields = columns.iter().map(field).collect::<Result<Vec<_>, _>>()?;
    Type::group_type_builder("sweep").with_fields(fields).build().map(Arc::new)
}

fn write_group(
    writer: &mut SerializedFileWriter<File>,
    columns: &[Column],
    rows: &[Vec<Cell>],
) -> Result<(), ParquetError> {
    let mut group = writer.next_row_group()?;
    for (index, column) in columns.iter().enumerate() {
        let Some(mut chunk) = group.next_column()? else { break };
        let cells = rows.iter().map(|row| row.get(index));
        match column.kind {
            ColumnKind::Number => {
                let numbers: Vec<f64> = cells.map(number).collect();
                chunk.typed::<DoubleType>().write_batch(&numbers, None, None)?;
            }
            ColumnKind::Word => {
                let words: Vec<ByteArray> = cells.map(|cell| word(cell).into()).collect();
                chunk.typed::<ByteArrayType>().write_batch(&words, None, None)?;
            }
        }
        chunk.close()?;
    }
    group.close()?;
    Ok(())
}

/// Returns a cell as a number; NaN for other cells.
pub(crate) fn number(cell: Option<&Cell>) -> f64 {
    match cell {
        Some(Cell::Number(Some(value))) => *value,
        _ => f64::NAN,
    }
}

fn word(cell: Option<&Cell>) -> &str {
    match cell {
        Some(Cell::Word(word)) => word,
        _ => "",
    }
}
