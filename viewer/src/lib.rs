//! The viewer. Not finished: there is no program here yet; see the README of this folder.
