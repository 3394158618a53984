//! Replay that starts near the failure of a run: a recording, and the state of the models shortly before.

use crate::case::Case;
use crate::minimise::ShortestRun;
use crate::process::{Flotor, ProcessResult};
use std::fs;
use std::path::Path;

/// Number of ticks between the saved state and the tick that fails.
const LEAD: u64 = 10;

/// Returns the arguments of a replay that starts some ticks before the failure and fails with the same error as the
/// replay of the whole run; `None` without such a replay: of a failed device, of models whose state cannot be saved, or of
/// results that the host replaced in the run and replaces in the replay. The files of the replay are written beside
/// `picture`, and removed without such a replay.
pub(crate) fn near_failure(
    flotor: &Flotor,
    case: &Case<'_>,
    shortest: &ShortestRun,
    picture: &Path,
) -> Option<Vec<String>> {
    let files = ["mcap", "state.json"].map(|ending| picture.with_extension(ending));
    // A recording is not overwritten.
    let remove = || files.iter().for_each(|file| drop(fs::remove_file(file)));
    remove();
    let near = replay_of(flotor, case, shortest, files.each_ref().map(|file| file.display().to_string()));
    if near.is_none() {
        remove();
    }
    near
}

fn replay_of(
    flotor: &Flotor,
    case: &Case<'_>,
    shortest: &ShortestRun,
    [recording, state]: [String; 2],
) -> Option<Vec<String>> {
    let recorded = shortest.arguments.iter().cloned().chain(["--record".to_owned(), recording.clone()]);
    flotor.run(recorded, "").ok()?;
    // A scene may name a plugin by a file beside it; a recording names the plugin alone.
    let beside = case.file.scene.parent().filter(|folder| *folder != Path::new(""));
    let beside = beside.unwrap_or(Path::new(".")).display().to_string();
    let replay = |further: &[&str]| {
        let folders = case.file.plugin_path.arguments().map(|word| word.to_string_lossy().into_owned());
        let further = further.iter().map(|word| (*word).to_owned());
        let beside = ["--plugin-path".to_owned(), beside.clone()];
        let replay = ["replay".to_owned(), recording.clone()].into_iter();
        replay.chain(folders).chain(beside).chain(further).collect::<Vec<_>>()
    };
    let tick = shortest.ticks.saturating_sub(1 + LEAD).to_string();
    let whole = flotor.run(replay(&["--save-state", &state, "--at-tick", &tick]), "").ok()?;
    // Without a state the replay failed before its first tick.
    fs::metadata(&state).ok()?;
    let near = replay(&["--from-state", &state]);
    let again = flotor.run(&near, "").ok()?;
    is_same_failure(&whole, &again).then_some(near)
}

fn is_same_failure(whole: &ProcessResult, again: &ProcessResult) -> bool {
    whole.code != Some(0) && (whole.code, &whole.error) == (again.code, &again.error)
}
