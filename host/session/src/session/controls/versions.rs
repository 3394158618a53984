//! Versions of a plugin in a run: the first one and its replacements, by generation.

use super::super::plugin_report::PluginReport;
use std::collections::VecDeque;

/// Capacity that stays allocated: for the version in place, the previous version, a version that fades in, and a version that fades
/// out.
const USUAL_VERSIONS: usize = 4;

/// Plugin of one device or model that a run began with, and its replacements.
pub(super) struct Versions {
    pub(super) first: PluginReport,
    /// Replacements that reports may still refer to, oldest first.
    pub(super) later: VecDeque<Version>,
    /// The newest generation.
    newest: u16,
    /// The generation that new values are checked against.
    pub(super) current: u16,
    /// The newest generation that the loop has put in place.
    pub(super) in_place: u16,
}

/// Source of the choice of a replacement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in super::super) enum ChosenBy {
    /// Name, in the scene or from a user.
    Name,
    /// Seed of the run, among several alternatives; hidden from reports.
    Seed,
}

/// Replacement of a plugin.
pub(super) struct Version {
    pub(super) generation: u16,
    pub(super) report: PluginReport,
    pub(super) chosen_by: ChosenBy,
    /// True once the loop has returned the replacement.
    pub(super) is_retired: bool,
}

impl Versions {
    /// Creates the versions of a plugin without replacements.
    pub(super) fn new(first: &PluginReport) -> Self {
        Self { first: first.clone(), later: VecDeque::new(), newest: 0, current: 0, in_place: 0 }
    }

    /// Returns the plugin of a generation, or the first plugin if that generation was dropped.
    pub(super) fn get(&self, generation: u16) -> &PluginReport {
        let version = self.later.iter().find(|version| version.generation == generation);
        version.map_or(&self.first, |version| &version.report)
    }

    /// Adds a replacement and returns its generation. Generation 0 is the plugin of the scene. After the largest number the count
    /// continues at 1, whose replacement was dropped long before.
    pub(super) fn add(&mut self, report: PluginReport, chosen_by: ChosenBy) -> u16 {
        self.newest = self.newest.checked_add(1).unwrap_or(1);
        self.current = self.newest;
        self.later.push_back(Version { generation: self.newest, report, chosen_by, is_retired: false });
        self.newest
    }

    /// Records that the loop has returned a generation, which may be dropped.
    pub(super) fn retire(&mut self, generation: u16) {
        let mut later = self.later.iter_mut();
        if let Some(version) = later.find(|version| version.generation == generation) {
            version.is_retired = true;
        }
        self.forget();
    }

    /// Drops replacements that no report can refer to any more, so that memory stays bounded. A pending change may refer to the
    /// version before the one in place, and the loop may hold an older version that it has not returned.
    pub(super) fn forget(&mut self) {
        let in_place = self.later.iter().position(|version| version.generation == self.in_place);
        let mut old = in_place.unwrap_or(0).saturating_sub(1);
        while old > 0 && self.later.front().is_some_and(|version| version.is_retired) {
            self.later.pop_front();
            old -= 1;
        }
        // Frees the capacity of an earlier burst.
        self.later.shrink_to(USUAL_VERSIONS);
    }

    /// Returns the plugin that new values are checked against.
    pub(super) fn now(&self) -> &PluginReport {
        self.get(self.current)
    }
}
