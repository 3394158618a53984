//! Lookup of files named by parameters of a recorded run, by their content.

use flotor_record::NamedFile;
use flotor_session::scene::{Location, ParameterText, SceneError};
use std::path::{Path, PathBuf};

/// Returns a setting of `model`. A file name is replaced by the name of a file of equal content: at its place in the run, or beside
/// the recording, which may have been moved. `parameters`: parameters in the model's description.
///
/// # Errors
/// [`SceneError`] if no file has that content.
pub(super) fn as_recorded(
    set: &ParameterText,
    model: &str,
    parameters: &[(String, String)],
    recording: &Path,
) -> Result<ParameterText, SceneError> {
    let Some(then) = NamedFile::among(parameters, &set.key) else { return Ok(set.clone()) };
    let folder = recording.parent().unwrap_or(Path::new(""));
    let places: [PathBuf; 2] = [then.path.clone(), folder.join(&set.value)];
    let found: Vec<NamedFile> = places.iter().filter_map(|path| NamedFile::read(path).ok()).collect();
    if let Some(same) = found.iter().find(|file| file.hash == then.hash) {
        return Ok(ParameterText { value: same.path.to_string_lossy().into_owned(), ..set.clone() });
    }
    let what = match found.first() {
        Some(other) => format!(
            "`{}` is not the file of the run: its hash is {}, the hash of the run's file was {}",
            other.path.display(),
            other.hash_text(),
            then.hash_text()
        ),
        None => format!("`{}` no longer exists ({})", then.path.display(), then.hash_text()),
    };
    let problem = format!(
        "[{model}] `{key}`: {what}; put the file of the run beside the recording as `{written}`, or name another \
         file with `--set {model}.{key}=FILE`",
        key = set.key,
        written = set.value
    );
    Err(SceneError { location: Location { file: recording.into(), line: 0 }, problem })
}
