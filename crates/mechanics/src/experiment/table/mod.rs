//! Tables as other makers write them: any encoding, delimiter and decimal sign, named units, columns that are not needed.
//!
//! `experiment.toml` describes such a table ([`TableDescription`]), and [`propose`] finds a description by looking at one. What is read is the description's alone, so that
//! the same file always means the same.

mod description;
mod propose;
mod read;
mod spelling;
mod text;

pub use description::{ColumnName, PositionColumns, TableDescription, TimeFormat};
pub(super) use description::{KEYS, one_of};
pub use propose::{Ask, Given, Proposal, Question, propose};
pub(super) use read::{read_described, text_in};
pub use spelling::{Spelt, unit};
pub use text::{Decimal, Delimiter, Encoding, table_text};
