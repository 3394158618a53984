//! Replay that starts near the failure of a run: a recording, and the state of the models shortly before.

use crate::case::Case;
use crate::minimise::ShortestRun;
use crate::process::{Flotor, ProcessResult};
use std::path::Path;

/// Number of ticks between the saved state and the tick that fails.
const LEAD: u64 = 10;

/// Returns the arguments of a replay that starts some ticks before the failure and fails with the same error as the
/// replay of the whole run; `None` without such a replay: of a failed device, or of models whose state cannot be saved.
/// The files of the replay are written beside `picture`.
pub(crate) fn near_failure(
    flotor: &Flotor,
    case: &Case<'_>,
    shortest: &ShortestRun,
    picture: &Path,
) -> Option<Vec<String>> {
    let [recording, state] =
        ["mcap", "state.json"].map(|ending| picture.with_extension(ending).display().to_string());
    let recorded = shortest.arguments.iter().cloned().chain(["--record".to_owned(), recording.clone()]);
    flotor.run(recorded, "").ok()?;
    let replay = |further: &[&str]| {
        let folders = case.file.plugin_path.arguments().map(|word| word.to_string_lossy().into_owned());
        let further = further.iter().map(|word| (*word).to_owned());
        ["replay".to_owned(), recording.clone()].into_iter().chain(folders).chain(further).collect::<Vec<_>>()
    };
    let tick = shortest.ticks.saturating_sub(1 + LEAD).to_string();
    let whole = flotor.run(replay(&["--save-state", &state, "--at-tick", &tick]), "").ok()?;
    let near = replay(&["--from-state", &state]);
    let again = flotor.run(&near, "").ok()?;
    is_same_failure(&whole, &again).then_some(near)
}

fn is_same_failure(whole: &ProcessResult, again: &ProcessResult) -> bool {
    whole.code != Some(0) && (whole.code, &whole.error) == (again.code, &again.error)
}
