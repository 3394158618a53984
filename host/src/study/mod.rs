//! What a perception experiment (`flotor-study`) shows of itself: the page of its results.

mod report;

pub use report::html;
