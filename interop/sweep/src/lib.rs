//! Sweeps: the same question at many parameters, poses and seeds, into one table.
//!
//! ```text
//! PLAN.toml -> plan (axes, seeds, what to run) -> tasks (blocks of points, keyed by content)
//!           -> executor (threads here, Dask or Ray through the wheel) -> store (a file a finished task)
//!           -> table (Parquet) -> picture (SVG)
//! ```
//!
//! A task is a pure function of its content: plan, points and plugin files. Its key is a hash of exactly that, its
//! result one file named by the key that appears whole or not at all. So a killed sweep goes on where it was, two
//! workers may do the same task, and whoever does it, the table has the same bytes.
//!
//! - [`plan`]: what is asked, read from TOML and checked.
//! - [`design`]: from axes to points.
//! - [`task`]: a block of points, its key, and how it is run.
//! - [`store`]: finished tasks on disk.
//! - [`executor`]: tasks on the cores of this machine.
//! - [`table`]: rows into Parquet, and [`picture`] of them.

pub mod design;
pub mod executor;
pub mod picture;
pub mod plan;
pub mod store;
pub mod table;
pub mod task;
