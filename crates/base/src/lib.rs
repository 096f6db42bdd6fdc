//! Errors, files, units, parameters and distributions, which every other crate uses.

pub mod distribution;
pub mod elementary;
pub mod error;
pub mod files;
pub mod number;
pub mod parameter;
pub mod quantities;
pub mod sha256;
pub mod toml_input;
pub mod units;

pub use error::{Error, Result};

/// Defines an enum whose variants have a fixed text each, the method that returns the text, and the list `ALL` of the variants in their order.
#[macro_export]
macro_rules! named_enum {
    (
        $(#[$($meta:tt)*])*
        $vis:vis enum $Enum:ident { $($(#[$($variant_meta:tt)*])* $Variant:ident = $text:literal,)* }
        $(#[$($method_meta:tt)*])*
        $method_vis:vis fn $method:ident
    ) => {
        $(#[$($meta)*])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        $vis enum $Enum { $($(#[$($variant_meta)*])* $Variant,)* }

        impl $Enum {
            /// All variants, in the order of the enum.
            pub const ALL: [Self; [$($text),*].len()] = [$(Self::$Variant),*];

            $(#[$($method_meta)*])*
            $method_vis fn $method(self) -> &'static str {
                match self {
                    $(Self::$Variant => $text,)*
                }
            }
        }
    };
}
