//! Message at the end of a run of a study of one's own design.

use crate::of_dataset;
use flotor_command::{CommandError, command_line, say, style};
use flotor_study::designed::DesignedData;

/// Prints the number of complete sessions, and the next command.
pub(super) fn tell(data: &DesignedData) -> Result<(), CommandError> {
    let logs = data.logs().map_err(of_dataset)?;
    let complete = logs.iter().filter(|log| log.complete).count();
    let trials: u32 = logs.iter().map(|log| log.course().presented()).sum();
    let root = data.root().display();
    say!("{}", style::title(&format!("{complete} of {} sessions complete", logs.len())));
    say!("  {trials} presentations in {root}");
    if complete < logs.len() {
        say!("  run the command again to continue");
    } else {
        say!("  {}", command_line(["analyse", root.to_string().as_str()]));
    }
    Ok(())
}
