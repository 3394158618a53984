//! What the window shows: nothing yet, a running host, or a recording.

use crate::feed::{Feed, FeedState};
use crate::panel::{Panel, Use};
use crate::shape::{Shape, file_of, load_file, shapes_of};
use egui::Context;
use flotor_live::{Client, Directory, LiveError, PanelPlugin};
use flotor_record::RunDescription;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// Between two pictures of a running host on a GPU, and on a software adapter, which needs the processor for itself.
pub(super) const FRAME: Duration = Duration::from_millis(16);
pub(super) const FRAME_ON_CPU: Duration = Duration::from_millis(33);
/// The same where nothing that moves is in sight: counts and words go on.
pub(super) const FRAME_OF_WORDS: Duration = Duration::from_millis(250);

/// How soon ticks that have come are to be seen: said by the window, followed by the thread that reads them.
#[derive(Clone, Debug)]
pub struct Pace(Arc<AtomicU64>);

impl Pace {
    /// A picture so long after the last one.
    #[must_use]
    pub fn of(frame: Duration) -> Self {
        let pace = Self(Arc::default());
        pace.set(frame);
        pace
    }

    /// Changes it.
    pub fn set(&self, frame: Duration) {
        self.0.store(u64::try_from(frame.as_millis()).unwrap_or(u64::MAX), Ordering::Relaxed);
    }

    fn frame(&self) -> Duration {
        Duration::from_millis(self.0.load(Ordering::Relaxed))
    }
}

/// Which run is to be watched.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Wanted {
    /// Where runs are found.
    pub directory: Directory,
    /// The process that runs it; without one, the newest.
    pub process: Option<u32>,
    /// Files of the plugins whose bodies are drawn if the window opens a recording instead.
    pub plugins: Vec<PathBuf>,
}

impl Wanted {
    /// The newest run of a folder.
    #[must_use]
    pub fn newest(directory: Directory) -> Self {
        Self { directory, process: None, plugins: Vec::new() }
    }
}

/// Where ticks come from.
pub enum Source {
    /// No run yet.
    Waiting(Wanted),
    /// A running host.
    Live {
        /// The connection.
        feed: Box<Feed>,
        /// What is looked for when it is over.
        wanted: Wanted,
    },
    /// A file.
    Recording,
}

impl Source {
    /// True for a run that can be stopped and changed.
    #[must_use]
    pub fn is_running(&self) -> bool {
        matches!(self, Self::Live { feed, .. } if feed.state() == FeedState::Running)
    }
}

/// Connects to a run; the window is woken whenever there is something new.
///
/// # Errors
/// [`LiveError`]: there is none, or it cannot be watched.
pub fn connect(wanted: &Wanted, context: &Context, pace: &Pace) -> Result<Feed, LiveError> {
    let (context, pace) = (context.clone(), pace.clone());
    let client = match wanted.process {
        Some(process) => Client::of_process(&wanted.directory, process)?,
        None => Client::find(&wanted.directory)?,
    };
    Feed::start(client, move || context.request_repaint_after(pace.frame()))
}

/// Bodies and panels of a run.
pub(super) struct Parts {
    /// What can be drawn.
    pub(super) shapes: Vec<Shape>,
    /// What can be set.
    pub(super) panels: Vec<Panel>,
    /// What is missing, in words.
    pub(super) missing: Vec<String>,
}

impl Parts {
    /// Of a running host: its plugins lie where it says.
    #[must_use]
    pub(super) fn of_host(feed: &Feed) -> Self {
        let files: Vec<PathBuf> = feed.greeting().plugins.iter().map(|plugin| plugin.file.clone()).collect();
        let (mut shapes, missing) = shapes_of(feed.run(), &files);
        let panels = feed.greeting().plugins.iter().map(|plugin| panel(plugin, &mut shapes)).collect();
        Self { shapes, panels, missing: missing.iter().map(ToString::to_string).collect() }
    }

    /// Of a recording: plugins as far as they were found.
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
            Panel::new(&PanelPlugin::new(name, id, file, schema(id), &plugin.parameters, &[]), Use::Read)
        });
        let panels = panels.collect();
        Self { shapes, panels, missing: missing.iter().map(ToString::to_string).collect() }
    }
}

/// A panel that can be pulled; the instance that is drawn is brought to the values in force.
fn panel(plugin: &PanelPlugin, shapes: &mut [Shape]) -> Panel {
    let mut panel = Panel::new(plugin, Use::Change);
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
