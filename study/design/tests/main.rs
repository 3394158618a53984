//! Properties of designs, procedures and observers.
