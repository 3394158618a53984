//! Host side of `flotor.soft-range/1`: ranges in which a live number is usefully moved by hand.

use crate::Plugin;
use crate::declaration::static_list;
use flotor_hal::SoftRange;

impl Plugin {
    /// Returns the soft ranges that a model declares; empty without the extension and for a device.
    #[must_use]
    pub fn soft_ranges(&self) -> &'static [SoftRange] {
        let table = self.model_extensions().and_then(|extensions| extensions.soft_range);
        // SAFETY: a table's list is a static array of `range_count` ranges of the checked layout.
        table.map_or(&[], |table| unsafe { static_list(table.ranges, table.range_count) })
    }

    /// Returns the soft range of a parameter, declared or [around](SoftRange::around) the current value; `None` for an
    /// unknown index, and for a parameter that is not a number. Not real-time.
    #[must_use]
    pub fn soft_range(&self, index: usize, value: f64) -> Option<SoftRange> {
        let parameter = self.parameters().get(index)?;
        let declared = self.soft_ranges().iter().find(|range| range.id() == parameter.id());
        declared.and_then(|range| range.within(parameter)).or_else(|| SoftRange::around(parameter, value))
    }
}
