//! Properties of designs, orders, methods, courses and observers.

mod balance;
mod courses;
mod drafts;
mod methods;
mod support;
