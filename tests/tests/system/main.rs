//! The product as its users have it: programs, plugin libraries, scenes, documents. One program, a module a question; a part of it
//! runs by its name: `cargo test -p flotor-tests golden`.

mod architecture;
mod asynchronous_models;
mod book;
mod c_plugins;
mod calibration;
mod changes;
mod composition;
mod crash;
mod determinism;
mod documents;
mod force_sensor;
mod golden;
mod haply;
mod isolation;
mod live;
mod maglev;
mod oracle;
mod parsers;
mod physics;
mod plugins;
mod reach;
mod reference;
mod refusal;
mod replay;
mod rod;
mod safety;
mod scaffold;
mod scene;
mod simulated;
mod study;
mod swap;
mod teleoperation;
mod two_hosts;
mod validate;
mod z_width;
