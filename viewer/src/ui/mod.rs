//! Parts of the interface, used by window, tests and headless pictures.

pub mod device_row;
pub mod export_options;
pub mod force_position;
pub mod handle;
pub mod help;
pub mod key;
pub mod legend;
pub mod marks;
pub mod messages;
pub mod overlay;
pub mod parameters;
pub mod playback;
pub mod plot_stack;
pub mod plots;
pub mod readout;
pub mod standing;
pub mod style;
pub mod top_bar;
pub mod view3d;
pub mod zoom;
