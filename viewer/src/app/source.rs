//! Source of the window's data: no run yet, a running host, or a recording.

use crate::feed::{Feed, FeedState};
use crate::guide::Guide;
use crate::panel::{Panel, PanelPurpose};
use crate::shape::{Shape, file_of, load_file, shapes_of};
use egui::Context;
use flotor_live::{Client, Directory, LiveError, PanelPlugin, WrenchLimits};
use flotor_record::RunDescription;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// Frame intervals of a running host on a GPU, and on a software adapter, which itself uses the processor.
pub(super) const FRAME: Duration = Duration::from_millis(16);
pub(super) const FRAME_ON_CPU: Duration = Duration::from_millis(33);
/// Frame interval while only counts and texts change.
pub(super) const FRAME_OF_WORDS: Duration = Duration::from_millis(250);

/// Frame interval, set by the window and read by the thread that receives ticks.
#[derive(Clone, Debug)]
pub struct Pace(Arc<AtomicU64>);

impl Pace {
    /// Creates a pace with this frame interval.
    #[must_use]
    pub fn of(frame: Duration) -> Self {
        let pace = Self(Arc::default());
        pace.set(frame);
        pace
    }

    /// Changes the frame interval.
    pub fn set(&self, frame: Duration) {
        self.0.store(u64::try_from(frame.as_millis()).unwrap_or(u64::MAX), Ordering::Relaxed);
    }

    fn frame(&self) -> Duration {
        Duration::from_millis(self.0.load(Ordering::Relaxed))
    }
}

/// Selection of the run to watch.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunSelection {
    /// Directory of the runs.
    pub directory: Directory,
    /// Process id of the run; `None`: the newest run.
    pub process: Option<u32>,
    /// Plugin files for drawing the bodies of a recording, if the window opens one instead.
    pub plugins: Vec<PathBuf>,
}

impl RunSelection {
    /// Selects the newest run of a directory.
    #[must_use]
    pub fn newest(directory: Directory) -> Self {
        Self { directory, process: None, plugins: Vec::new() }
    }
}

/// Source of ticks.
pub enum Source {
    /// No run yet.
    Waiting(RunSelection),
    /// A running host.
    Live {
        /// Connection to the host.
        feed: Box<Feed>,
        /// Selection of the next run, once this run is over.
        wanted: RunSelection,
    },
    /// A recording.
    Recording,
}

impl Source {
    /// Returns whether a run is in progress, which can be stopped and changed.
    #[must_use]
    pub fn is_running(&self) -> bool {
        matches!(self, Self::Live { feed, .. } if feed.state() == FeedState::Running)
    }
}

/// Connects to a run; new data requests a repaint of the window.
///
/// # Errors
/// [`LiveError`] if there is no such run or the connection fails.
pub fn connect(wanted: &RunSelection, context: &Context, pace: &Pace) -> Result<Feed, LiveError> {
    let (context, pace) = (context.clone(), pace.clone());
    let client = match wanted.process {
        Some(process) => Client::of_process(&wanted.directory, process)?,
        None => Client::find(&wanted.directory)?,
    };
    Feed::start(client, move || context.request_repaint_after(pace.frame()))
}

/// Bodies and panels of a run.
pub(super) struct Parts {
    /// Bodies for the 3D view.
    pub(super) shapes: Vec<Shape>,
    /// Panels for the parameters.
    pub(super) panels: Vec<Panel>,
    /// Messages about missing bodies.
    pub(super) missing: Vec<String>,
    /// Hands that can be guided.
    pub(super) guide: Guide,
    /// Limits of the wrench.
    pub(super) limits: WrenchLimits,
}

impl Parts {
    /// Builds the parts of a running host, from the plugin files of its greeting.
    #[must_use]
    pub(super) fn of_host(feed: &Feed) -> Self {
        let plugins = &feed.greeting.plugins;
        let files: Vec<PathBuf> = plugins.iter().map(|plugin| plugin.file.clone()).collect();
        let (mut shapes, missing) = shapes_of(&feed.run, &files);
        let panels = plugins.iter().map(|plugin| panel(plugin, &mut shapes)).collect();
        let missing = missing.iter().map(ToString::to_string).collect();
        Self { shapes, panels, missing, guide: Guide::new(plugins), limits: feed.greeting.limits }
    }

    /// Builds the parts of a recording, from the plugin files that were found.
    #[must_use]
    pub(super) fn of_recording(run: &RunDescription, files: &[PathBuf]) -> Self {
        let (shapes, missing) = shapes_of(run, files);
        let schema = |id: &str| {
            let plugin = file_of(files, id).and_then(|file| load_file(file).ok());
            plugin.map_or(&[][..], |plugin| plugin.parameters())
        };
        let panels = run.plugins.iter().map(|plugin| {
            let file = PathBuf::from(&plugin.file);
            let (name, id) = (plugin.name.as_str(), plugin.id.as_str());
            Panel::new(
                &PanelPlugin::new(name, id, file, schema(id), &plugin.parameters, &[]),
                PanelPurpose::Read,
            )
        });
        let (panels, missing) = (panels.collect(), missing.iter().map(ToString::to_string).collect());
        Self { shapes, panels, missing, guide: Guide::new(&[]), limits: WrenchLimits::default() }
    }
}

/// Creates an editable panel, and sets the drawn instance to the values in force.
fn panel(plugin: &PanelPlugin, shapes: &mut [Shape]) -> Panel {
    let mut panel = Panel::new(plugin, PanelPurpose::Change);
    if let Some(shape) = shapes.iter_mut().find(|shape| shape.name() == plugin.name) {
        for parameter in plugin.parameters.iter().filter(|parameter| parameter.live) {
            if let Ok(number) = parameter.value.parse() {
                shape.set_parameter(&parameter.id, number);
            }
        }
        panel.follow(shape);
    }
    panel
}
