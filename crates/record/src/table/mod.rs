//! Reader of foreign tables, which may have any encoding, delimiter, decimal sign and units, and columns that are not used.
//!
//! The file `experiment.toml` describes a foreign table ([`TableDescription`]). The function [`propose`] infers such a description from a table.
//! Reading depends on the description alone, so a file has only one meaning.

mod asked;
mod blocks;
mod description;
mod propose;
mod read;
mod roles;
mod several;
mod spelling;
mod steps;
mod text;
mod unread;

pub use asked::{Ask, Question, TableSettings};
pub use description::{BlankForce, ColumnName, PositionColumns, TableDescription, TableLayout, TimeFormat};
pub(super) use description::{KEYS, SWEEP_KEYS, Units, column, read_choice};
pub use propose::{InspectedTable, TableProposal, choose_table, inspect_table, inspect_tables, propose, tracks};
pub(crate) use read::read_described;
pub use read::{ColumnNames, decode_table};
pub use roles::columns_beside;
pub(crate) use roles::{listed_columns, told_column};

pub use spelling::{ParsedUnit, bracketed, clock_word, factor, is_angular, split_unit, unit};
pub use text::{Decimal, Delimiter, Encoding, Thousands, cells, decode_detected, is_blank_or_comment};
pub use unread::UnreadColumn;
pub(crate) use unread::unread_columns;
