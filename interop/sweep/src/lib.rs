//! Sweeps: evaluations or runs over many parameters, poses and seeds, into one table.
//!
//! ```text
//! PLAN.toml -> plan (axes, seeds, what to run) -> tasks (blocks of points, keyed by content)
//!           -> executor (threads here, Dask or Ray through the wheel) -> store (one file per finished task)
//!           -> table (Parquet) -> picture (SVG)
//! ```
//!
//! A task is a pure function of its content: plan, points and plugin files. Its key is a hash of that content, its
//! result one file named by the key and written atomically. A killed sweep therefore resumes, two workers may execute the
//! same task, and the table has the same bytes with any executor.
//!
//! - [`plan`]: the plan of a sweep, read from TOML and checked.
//! - [`design`]: from axes to points.
//! - [`task`]: a block of points, its key, and its execution.
//! - [`store`]: finished tasks on disk.
//! - [`executor`]: tasks on the cores of this machine.
//! - [`table`]: writes rows to Parquet. [`picture`]: draws them.

pub mod design;
pub mod executor;
pub mod picture;
pub mod plan;
pub mod store;
pub mod table;
pub mod task;
