//! Extension `flotor.details/1`: numbers about the last answer, for people and for tests.
//!
//! A model that iterates, switches branches or rolls on its seat knows more than a wrench says. It names the
//! numbers once, and whoever wants them asks after a step: `flotor eval --details` makes columns of them. The
//! servo never asks.

use crate::ForceModel;
use crate::abi::{Str, StrList};

/// One number about an answer. Built with [`Detail::number`], [`Detail::word`] or [`Detail::flag`].
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct Detail {
    id: Str,
    unit: Str,
    doc: Str,
    words: StrList,
}

impl Detail {
    /// A number, in SI. `unit` is for people ("rad", "1" for none).
    #[must_use]
    pub const fn number(id: &'static str, unit: &'static str, doc: &'static str) -> Self {
        Self { id: Str::new(id), unit: Str::new(unit), doc: Str::new(doc), words: StrList::EMPTY }
    }

    /// One of a fixed list of words; the number is its index.
    #[must_use]
    pub const fn word(id: &'static str, words: &'static [Str], doc: &'static str) -> Self {
        Self { id: Str::new(id), unit: Str::EMPTY, doc: Str::new(doc), words: StrList::new(words) }
    }

    /// Yes or no: `1` or `0`.
    #[must_use]
    pub const fn flag(id: &'static str, doc: &'static str) -> Self {
        const NO_YES: [Str; 2] = [Str::new("0"), Str::new("1")];
        Self::word(id, &NO_YES, doc)
    }

    /// Name of the column.
    #[must_use]
    pub const fn id(&self) -> &str {
        self.id.as_str()
    }

    /// Unit for people; empty for a word.
    #[must_use]
    pub const fn unit(&self) -> &str {
        self.unit.as_str()
    }

    /// One sentence for people.
    #[must_use]
    pub const fn doc(&self) -> &str {
        self.doc.as_str()
    }

    /// The words, in index order; empty for a number.
    #[must_use]
    pub const fn words(&self) -> &[Str] {
        self.words.as_slice()
    }
}

/// A force model that has numbers about its answers.
pub trait DetailedModel: ForceModel {
    /// What there is to know, in order.
    const DETAILS: &'static [Detail];

    /// Writes the numbers of the last [`ForceModel::step`], one for each of [`Self::DETAILS`]; NaN where there is
    /// none. Real-time: bounded, no allocation.
    fn details(&self, values: &mut [f64]);
}
