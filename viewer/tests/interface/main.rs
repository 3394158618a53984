//! Every panel and screen by its accessibility tree, without display or GPU: what a person can find, press and pull, and
//! what comes of it at the host.

mod contact;
mod devices;
mod effort;
mod hand;
mod live;
mod look;
mod opening;
mod recording;
mod sitting;
#[path = "../support/mod.rs"]
mod support;
mod texts;
mod traces;
mod window;
