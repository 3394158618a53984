//! Sessions and blocks of a schedule.

use serde::Serialize;

/// One session of a subject.
#[derive(Serialize)]
pub(super) struct SessionRow {
    pub(super) subject: String,
    pub(super) session: u32,
    /// Blocks in order.
    pub(super) blocks: Vec<BlockRow>,
    pub(super) practice: u32,
    pub(super) trials: u32,
    pub(super) rests: u32,
    pub(super) questionnaires: u32,
    pub(super) minutes: f64,
}

/// One block of a session.
#[derive(Clone, Serialize)]
pub(super) struct BlockRow {
    pub(super) condition: String,
    pub(super) from_minute: f64,
    pub(super) to_minute: f64,
}
