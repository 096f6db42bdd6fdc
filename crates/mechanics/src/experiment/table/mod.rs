//! Tables as other makers write them: any encoding, delimiter and decimal sign, named units, columns that are not needed.
//!
//! `experiment.toml` describes such a table ([`TableDescription`]), and [`propose`] finds a description by looking at one. What is read is the description's alone, so that
//! the same file always means the same.

mod description;
mod propose;
mod read;
mod spelling;
mod text;

pub use description::{ColumnName, TableDescription, TimeFormat, Zero};
pub(super) use description::{KEYS, fits_offset, one_of};
pub use propose::{Given, Proposal, propose};
pub(super) use read::read_described;
pub use spelling::{Spelt, unit};
pub use text::{Decimal, Delimiter, table_text};
