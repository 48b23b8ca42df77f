//! Names of the methods: the words of rig files, tables and reports.
//!
//! A method describes itself in its own file of [`crate::deconvolution::method`].

use serde::{Deserialize, Serialize};

use super::keys::Word;
use crate::deconvolution::method::{
    About, blocks, digital, hybrid, paper, richardson_lucy, wiener,
};

/// Declares the enum of methods from each one's documentation and description.
macro_rules! method_names {
    ($($(#[doc = $doc:literal])* $method:ident: $about:expr,)*) => {
        /// A method that a rig file can name.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
        #[serde(into = "&'static str", try_from = "String")]
        pub enum MethodName { $($(#[doc = $doc])* $method,)* }

        impl MethodName {
            /// All methods.
            pub const ALL: [MethodName; Self::WORDS.len()] = [$(MethodName::$method),*];
            /// Words in a rig file.
            pub(super) const WORDS: &'static [Word] =
                &[$(Word { word: $about.name, meaning: concat!($($doc),*) }),*];

            /// Description of the method.
            pub const fn about(self) -> &'static About {
                match self { $(MethodName::$method => &$about),* }
            }
        }
    };
}

method_names! {
    /// The paper's loop as printed.
    Paper: paper::ABOUT,
    /// Lens model only.
    Digital: digital::ABOUT,
    /// Lens model, certified and corrected by captures.
    Hybrid: hybrid::ABOUT,
    /// `hybrid` with block matching as prior: better and slower.
    BlockMatching: blocks::ABOUT,
    /// Wiener filter by patches.
    Wiener: wiener::ABOUT,
    /// Richardson–Lucy.
    RichardsonLucy: richardson_lucy::ABOUT,
}

impl MethodName {
    /// Word in rig files, tables and reports.
    pub const fn name(self) -> &'static str {
        self.about().name
    }
}

impl From<MethodName> for &'static str {
    fn from(method: MethodName) -> &'static str {
        method.name()
    }
}

impl TryFrom<String> for MethodName {
    type Error = String;

    fn try_from(word: String) -> Result<MethodName, String> {
        let named = MethodName::ALL.into_iter().find(|method| method.name() == word);
        named.ok_or_else(|| format!("found the method {word}, which relens does not have"))
    }
}
