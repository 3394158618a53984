//! Vector quantity over time, collected sample by sample: yields a panel of three components, or the reason why it is not drawn.

use super::{Axis, Panel, Quantity, Series, Trace};

/// Traces of the components x, y and z of a quantity, in the unit of its axis.
#[derive(Debug, Clone)]
pub struct VectorTrace {
    quantity: Quantity,
    components: [Trace; 3],
}

impl VectorTrace {
    /// Creates empty traces of a quantity.
    #[must_use]
    pub fn new(quantity: Quantity) -> Self {
        Self { quantity, components: Default::default() }
    }

    /// Adds a sample: `x` in the unit of the x axis, `si` in SI units; a component that is not finite breaks its line. May
    /// allocate, as [`Trace`] does.
    pub fn add(&mut self, x: f64, si: [f64; 3]) {
        let (_, per_si) = self.quantity.unit();
        self.components.iter_mut().zip(si).for_each(|(trace, value)| trace.add(x, value * per_si));
    }

    /// Returns a panel with one line per component, in the colours of x, y and z. The heading is `name` with its first letter
    /// capitalised.
    ///
    /// # Errors
    /// `name` and the reason, if there is no data, or all components are within half of the minimum range around zero.
    pub fn panel(self, name: &str) -> Result<Panel, String> {
        let (_, per_si) = self.quantity.unit();
        let least = self.quantity.least_range_si() * per_si;
        match self.components.iter().filter_map(Trace::largest).reduce(f64::max) {
            None => return Err(format!("{name} (no data)")),
            Some(0.0) => return Err(format!("{name} (0 throughout)")),
            Some(largest) if largest < 0.5 * least => {
                return Err(format!("{name} (within {} of 0)", self.quantity.text(0.5 * least)));
            }
            Some(_) => {}
        }
        let named = ["x", "y", "z"].into_iter().zip(self.components).enumerate();
        let panel = Panel::new(Axis::of(heading(name), self.quantity));
        Ok(named
            .fold(panel, |panel, (axis, (name, trace))| panel.series(Series::trace(name, trace).axis(axis))))
    }
}

/// Capitalises a name.
fn heading(name: &str) -> String {
    let mut letters = name.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Figure;

    fn trace(quantity: Quantity, z: impl Fn(u32) -> f64) -> VectorTrace {
        let mut trace = VectorTrace::new(quantity);
        (0..100).for_each(|tick| trace.add(f64::from(tick), [0.0, f64::NAN, z(tick)]));
        trace
    }

    #[test]
    fn a_panel_of_nothing_is_a_line_of_text() {
        for (quantity, z, why) in [
            (Quantity::Angle, 0.0, "rotation (0 throughout)"),
            (Quantity::Angle, 1.0e-18, "rotation (within 0.005° of 0)"),
            (Quantity::Force, f64::NAN, "rotation (0 throughout)"),
        ] {
            let left_out = trace(quantity, |tick| z * f64::from(tick % 3)).panel("rotation");
            assert_eq!(left_out.err().as_deref(), Some(why));
        }
        assert_eq!(
            VectorTrace::new(Quantity::Force).panel("force").err().as_deref(),
            Some("force (no data)")
        );
        let figure = Figure::new("", Axis::linear("Time", "s")).subtitle("Seed 1.");
        let svg = figure.panel_or_note(trace(Quantity::Angle, |_| 0.0).panel("rotation")).to_svg();
        assert!(svg.contains(">Not drawn: rotation (0 throughout).<") && svg.contains(">Seed 1.<"), "{svg}");
    }

    #[test]
    fn a_signal_has_a_panel_in_the_unit_of_its_quantity() {
        let panel =
            trace(Quantity::Length, |tick| 1.0e-5 * f64::from(tick)).panel("position").expect("a signal");
        let svg = Figure::new("", Axis::linear("Time", "s")).panel(panel).to_svg();
        assert!(
            svg.contains(">Position <tspan")
                && svg.contains("(mm)")
                && svg.contains("z, 100 samples, 0 to 0.99"),
            "{svg}"
        );
    }
}
