//! The product as its users have it: programs, plugin libraries, scenes, documents. One program, a module a question; a part of it
//! runs by its name: `cargo test -p flotor-tests golden`.

mod architecture;
mod asynchronous_models;
mod bench_errors;
mod book;
mod boundary;
mod c_plugins;
mod calibration;
mod campaign;
mod changes;
mod composition;
mod crash;
mod damaged_inputs;
mod debug_texts;
mod demand;
mod determinism;
#[cfg(feature = "drop-ins")]
mod doctor;
mod documents;
#[cfg(feature = "drop-ins")]
mod drop_ins;
mod ends;
mod examples;
#[cfg(feature = "drop-ins")]
mod falcon;
mod force_sensor;
mod gallery;
mod golden;
mod grip;
mod hand_recording;
mod hanging_device;
mod haply;
mod identify;
mod inputs;
mod installation;
#[cfg(feature = "drop-ins")]
mod inverse3;
mod isolation;
mod judges;
mod latch;
mod left_running;
mod limits;
mod live;
mod maglev;
mod maglev_api;
mod names;
mod oracle;
mod parsers;
mod passivity;
mod physics;
mod pictures;
mod planted;
mod plugins;
mod printed;
mod reach;
mod recording_files;
mod reference;
mod refusal;
mod replay;
mod rod;
mod rooms;
mod safety;
mod saved_run;
mod scaffold;
mod scene;
mod scene_test;
#[cfg(feature = "drop-ins")]
mod services;
mod shared;
mod simulated;
mod slow_contacts;
mod snapshot;
mod stop_delivery;
mod stop_time;
mod study;
mod study_claims;
mod study_design;
mod study_designs_in_r;
mod study_file;
mod study_keyboard;
mod study_scripts;
mod supply;
mod swap;
mod teleoperation;
mod terminal;
mod two_hosts;
mod validate;
#[cfg(feature = "drop-ins")]
mod vendor_sdks;
mod worlds;
mod z_width;
