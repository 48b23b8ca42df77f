//! Names of the methods: the words of rig files, tables and reports.
//!
//! A method describes itself in its own file of [`crate::deconvolution::method`], by the same name.

use super::keys::words;

words! {
    /// A method that a rig file can name.
    pub enum MethodName {
        /// The paper's loop as printed.
        Paper = "paper",
        /// Lens model only.
        Digital = "digital",
        /// Lens model, certified and corrected by captures.
        Hybrid = "hybrid",
        /// `hybrid` with block matching as prior: better and slower.
        BlockMatching = "block-matching",
        /// Wiener filter by patches.
        Wiener = "wiener",
        /// Richardson–Lucy.
        RichardsonLucy = "richardson-lucy",
    }
}
