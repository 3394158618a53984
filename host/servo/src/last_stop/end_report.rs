//! End report of a process, in memory that its supervisor reads. Without a report, something other than the host's own code ended
//! the process.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, Ordering};

/// Word that the supervisor reads; unset in a process without a supervisor.
static WORD: OnceLock<&'static AtomicU32> = OnceLock::new();

/// Flag of a report with an exit code in the lowest byte.
const CODE: u32 = 0x100;
/// Report of a process that ends by a signal.
const SIGNAL: u32 = 0x200;

/// End of a process, as reported by the process itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReportedEnd {
    /// Exit with this code; result and errors are written.
    Code(u8),
    /// End by the last stop, after a signal or by a plugin; the message is written.
    Signal,
}

impl ReportedEnd {
    /// Decodes the end report in an atomic word; `None` if the process has not reported its end.
    #[must_use]
    pub fn read(word: &AtomicU32) -> Option<Self> {
        match word.load(Ordering::Acquire) {
            SIGNAL => Some(Self::Signal),
            code if code & CODE != 0 => Some(Self::Code((code & 0xff) as u8)),
            _ => None,
        }
    }
}

/// Sets the word for the end report of this process; later calls have no effect. Not real-time.
pub fn report_end_to(word: &'static AtomicU32) {
    let _ = WORD.set(word);
}

/// Reports the end of this process to its supervisor, if there is one; a later report replaces an earlier one. Safe in a signal
/// handler: takes no lock, allocates nothing.
pub fn report_end(end: ReportedEnd) {
    if let Some(word) = WORD.get() {
        let report = match end {
            ReportedEnd::Code(code) => CODE | u32::from(code),
            ReportedEnd::Signal => SIGNAL,
        };
        word.store(report, Ordering::Release);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_report_is_read_as_it_was_written() {
        static REPORT: AtomicU32 = AtomicU32::new(0);
        assert_eq!(ReportedEnd::read(&REPORT), None);
        report_end_to(&REPORT);
        for end in [ReportedEnd::Code(0), ReportedEnd::Code(130), ReportedEnd::Signal] {
            report_end(end);
            assert_eq!(ReportedEnd::read(&REPORT), Some(end));
        }
    }
}
