//! Tables as other makers write them: any encoding, delimiter and decimal sign, named units, columns that are not needed.
//!
//! `experiment.toml` describes such a table ([`TableDescription`]), and [`propose`] finds a description by looking at one. What is read is the description's alone, so that
//! the same file always means the same.

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
