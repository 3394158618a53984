//! The magnetic-levitation haptic device. Not finished: this crate exports no plugin yet, only what is known
//! about the device.

pub mod facts;
