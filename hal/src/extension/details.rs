//! Extension `flotor.details/1`: diagnostic numbers of the last step, for people and for tests.
//!
//! A model that iterates, switches branches or rolls on its seat has internal numbers beyond the wrench. The model
//! declares the numbers once; a caller reads them after a step, and `flotor eval --details` prints them as columns. The
//! servo loop never calls this extension.

use crate::abi::instance::call;
use crate::abi::interface::table;
use crate::abi::layout::layout;
use crate::abi::{CallStatus, Choices, Instance, ModelAdapter, Str};
use crate::{ForceModel, choices};

/// Diagnostic number of a step. Built with [`Detail::number`], [`Detail::word`] or [`Detail::flag`].
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
#[must_use]
pub struct Detail {
    id: Str,
    unit: Str,
    doc: Str,
    words: Choices,
}

impl Detail {
    /// Declares a number in SI units; `unit` is the unit to display ("rad", "1" for none).
    pub const fn number(id: &'static str, unit: &'static str, doc: &'static str) -> Self {
        Self { id: Str::new(id), unit: Str::new(unit), doc: Str::new(doc), words: Choices::EMPTY }
    }

    /// Declares a word from a fixed list; the value is the index of the word.
    pub const fn word(id: &'static str, words: Choices, doc: &'static str) -> Self {
        Self { id: Str::new(id), unit: Str::EMPTY, doc: Str::new(doc), words }
    }

    /// Declares a flag, with the value 1 or 0.
    pub const fn flag(id: &'static str, doc: &'static str) -> Self {
        Self::word(id, choices!["0", "1"], doc)
    }

    /// Returns the id, which is the column name in `flotor eval --details`.
    #[must_use]
    pub const fn id(&self) -> &str {
        self.id.as_str()
    }

    /// Returns the unit to display; empty for a word or a flag.
    #[must_use]
    pub const fn unit(&self) -> &str {
        self.unit.as_str()
    }

    /// Returns the description, one sentence.
    #[must_use]
    pub const fn doc(&self) -> &str {
        self.doc.as_str()
    }

    /// Returns the words, in index order; empty for a number.
    pub const fn words(&self) -> &[Str] {
        self.words.as_slice()
    }
}

/// Force model with diagnostic numbers of its steps.
///
/// ```
/// # use flotor_hal::*;
/// # struct Foam { depth_m: f64, look: Shape }
/// # impl ForceModel for Foam {
/// #     const INFO: ModelInfo = ModelInfo::new("foam", "Foam", "A soft ball");
/// #     fn create(_: &Settings<'_>) -> Result<Self, Refusal> {
/// #         Ok(Self { depth_m: 0.0, look: Shape::default() })
/// #     }
/// #     fn step(&mut self, _: &Input) -> Output { Wrench::ZERO.into() }
/// # }
/// use flotor_hal::extension::details::Detail;
///
/// /// A column of `flotor eval --details`: `export_model!(Foam, details)`.
/// impl DetailsModel for Foam {
///     const DETAILS: &'static [Detail] = &[Detail::number("depth", "m", "Depth of the handle in the foam")];
///
///     fn details(&self, values: &mut [f64]) {
///         values.iter_mut().for_each(|value| *value = self.depth_m);
///     }
/// }
/// # let foam = Foam { depth_m: 0.003, look: Shape::default() };
/// let mut values = [f64::NAN];
/// foam.details(&mut values);
/// assert_eq!(values, [0.003]);
/// ```
pub trait DetailsModel: ForceModel {
    /// Diagnostic numbers, in the order of the values.
    const DETAILS: &'static [Detail];

    /// Writes the values of the last [`ForceModel::step`], one for each of [`Self::DETAILS`]; NaN for a missing value.
    /// Real-time: bounded, no allocation.
    fn details(&self, values: &mut [f64]);
}

/// Function table `flotor.details/1`: see [`DetailsModel`].
#[repr(C)]
#[derive(Clone, Copy)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct DetailsTable {
    /// Size of this table in the plugin's build, bytes.
    pub size: u32,
    /// Number of details.
    pub detail_count: u32,
    /// Diagnostic numbers, constant.
    pub details: *const Detail,
    /// Writes the `detail_count` values of the last step, NaN for a missing value; returns a [`crate::abi::CallStatus`]
    /// code, `OutOfRange` if `capacity` is smaller than `detail_count`. Real-time: no allocation, lock, system call or
    /// unwinding.
    pub values: Option<unsafe extern "C" fn(instance: Instance, values: *mut f64, capacity: u32) -> u32>,
}

layout! {
    Detail { id, unit, doc, words }
    DetailsTable { size, detail_count, details, values }
}
unsafe extern "C" fn values<M: DetailsModel>(instance: Instance, values: *mut f64, capacity: u32) -> u32 {
    if (capacity as usize) < M::DETAILS.len() {
        return CallStatus::OutOfRange as u32;
    }
    if M::DETAILS.is_empty() {
        return CallStatus::Ok as u32;
    }
    // SAFETY: the contract of every table call; `values` has room for `capacity` numbers, of which there are enough.
    unsafe {
        call::<ModelAdapter<M>>(instance, |model| {
            model.details(std::slice::from_raw_parts_mut(values, M::DETAILS.len()));
            Ok(())
        })
    }
}

table!(DetailsTable: "flotor.details/1", M: [DetailsModel] {
    detail_count: M::DETAILS.len() as u32,
    details: M::DETAILS.as_ptr(),
    values: Some(values::<M>),
});
