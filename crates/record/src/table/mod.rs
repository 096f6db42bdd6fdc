//! Reads foreign tables: any encoding, delimiter and decimal sign, named units, and unused columns.
//!
//! `experiment.toml` describes such a table ([`TableDescription`]), and [`propose`] infers a description from a table. Reading depends on the description
//! alone, so a file always has one meaning.

mod asked;
mod blocks;
mod description;
mod propose;
mod read;
mod roles;
mod spelling;
mod text;
mod unread;

pub use asked::{Ask, Given, Question};
pub use description::{BlankForce, ColumnName, PositionColumns, TableDescription, TableLayout, TimeFormat};
pub(super) use description::{KEYS, SWEEP_KEYS, Units, column, one_of};
pub use propose::{Looked, Proposal, look, propose, tracks};
pub(crate) use read::read_described;
pub use read::{ColumnNames, text_in};
pub(super) use spelling::split_unit;
pub use spelling::{Spelt, unit};
pub use text::{Decimal, Delimiter, Encoding, Thousands, table_text};
pub(super) use text::{cells, is_aside};
pub use unread::UnreadColumn;
pub(crate) use unread::unread_columns;
