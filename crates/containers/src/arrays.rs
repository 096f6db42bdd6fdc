//! Arrays of numbers by their paths, and the tables that they form.

use std::collections::BTreeMap;

use crate::table_text::{TableText, number};

/// Largest number of columns of a matrix that counts as a table.
const MOST_COLUMNS: usize = 64;
/// Least number of values of a vector that counts as a column.
pub const FEWEST_ROWS: usize = 3;
/// Largest number of values in a container.
pub const MOST_VALUES: usize = 50_000_000;

/// Binary type of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NumberKind {
    /// IEEE 754 floating point.
    Float,
    /// Two's complement integer.
    Signed,
    /// Unsigned integer.
    Unsigned,
}

/// Type of the numbers in a binary array.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NumberType {
    /// Kind of the number.
    pub kind: NumberKind,
    /// Number of bytes.
    pub size: usize,
    /// True if the most significant byte comes first.
    pub is_big_endian: bool,
}

impl NumberType {
    /// Returns the number in the first [`Self::size`] bytes; `None` if there are fewer bytes or if the type is not supported.
    pub fn decode(self, bytes: &[u8]) -> Option<f64> {
        // The number's bytes, the least significant byte first.
        let mut ordered = [0; 8];
        let (found, place) = (bytes.get(..self.size)?, ordered.get_mut(..self.size)?);
        place.copy_from_slice(found);
        if self.is_big_endian {
            place.reverse();
        }
        let whole = u64::from_le_bytes(ordered);
        let n_unused_bits = 64 - 8 * self.size as u32;
        Some(match (self.kind, self.size) {
            (NumberKind::Float, 8) => f64::from_bits(whole),
            (NumberKind::Float, 4) => f64::from(f32::from_bits(whole as u32)),
            (NumberKind::Float, _) => return None,
            (NumberKind::Unsigned, 1 | 2 | 4 | 8) => whole as f64,
            (NumberKind::Signed, 1 | 2 | 4 | 8) => (((whole << n_unused_bits) as i64) >> n_unused_bits) as f64,
            _ => return None,
        })
    }

    /// Returns the number at byte `place` of every element of `element_size` bytes; `None` if the type is not supported or a number is incomplete.
    pub fn decode_all(self, bytes: &[u8], element_size: usize, place: usize) -> Option<Vec<f64>> {
        bytes.chunks(element_size.max(1)).map(|element| self.decode(element.get(place..)?)).collect()
    }
}

/// Name of a column and its values.
pub type Column = (String, Vec<f64>);
/// Vectors of one group, by their length.
type Group = BTreeMap<usize, Vec<Column>>;

/// Collector of arrays. Vectors of equal length in one group form a table, and a matrix with few columns is a table by itself.
#[derive(Debug, Default)]
pub struct Arrays {
    groups: Vec<(String, Group)>,
    matrices: Vec<(String, Vec<Column>)>,
    scalars: Vec<String>,
    notes: Vec<String>,
    n_values: usize,
}

impl Arrays {
    /// Adds a vector to a group.
    pub fn add_vector(&mut self, group: &str, name: &str, values: Vec<f64>) {
        match values.as_slice() {
            [] => {}
            [value] => self.scalars.push(format!("{}: {}", join_path(group, name), number(*value))),
            short if short.len() < FEWEST_ROWS => {}
            _ => {
                let place = self.groups.iter().position(|(other, _)| other == group).unwrap_or_else(|| {
                    self.groups.push((group.to_string(), Group::new()));
                    self.groups.len() - 1
                });
                self.groups[place].1.entry(values.len()).or_default().push((name.to_string(), values));
            }
        }
    }

    /// True if a group has a vector of this name and length.
    pub fn has_vector(&self, group: &str, name: &str, length: usize) -> bool {
        let vectors =
            self.groups.iter().filter(|(other, _)| other == group).filter_map(|(_, group)| group.get(&length));
        vectors.flatten().any(|(other, _)| other == name)
    }

    /// Adds an array with its values in column-major order. Arrays of more than two dimensions and large matrices are noted as unread.
    pub fn add(&mut self, group: &str, name: &str, shape: &[usize], values: Vec<f64>) {
        let extended: Vec<usize> = shape.iter().copied().filter(|n| *n != 1).collect();
        match *extended.as_slice() {
            [] | [_] => self.add_vector(group, name, values),
            [rows, columns] if rows >= columns && columns <= MOST_COLUMNS => {
                self.add_columns(group, name, values.chunks(rows.max(1)).map(<[f64]>::to_vec).collect());
            }
            [rows, columns] if rows <= MOST_COLUMNS => {
                let row =
                    |at: usize| (0..columns).filter_map(|column| values.get(column * rows + at).copied()).collect();
                self.add_columns(group, name, (0..rows).map(row).collect());
            }
            _ => self.note(format!("`{}` is an array of {shape:?} and is not read", join_path(group, name))),
        }
    }

    /// Adds an array with its values in row-major order, where the last dimension varies fastest. This is column-major order for the reversed shape.
    pub fn add_row_major(&mut self, group: &str, name: &str, shape: &[usize], values: Vec<f64>) {
        let reversed: Vec<usize> = shape.iter().rev().copied().collect();
        self.add(group, name, &reversed, values);
    }

    /// Adds the columns of a matrix. They have no names, so they are numbered.
    fn add_columns(&mut self, group: &str, name: &str, columns: Vec<Vec<f64>>) {
        if columns.first().is_none_or(|column| column.len() < FEWEST_ROWS) {
            return;
        }
        let columns = columns.into_iter().enumerate().map(|(place, values)| (format!("column {}", place + 1), values));
        self.add_table(&join_path(group, name), columns.collect());
    }

    /// Adds a table whose columns belong together.
    pub fn add_table(&mut self, title: &str, columns: Vec<Column>) {
        self.matrices.push((title.to_string(), columns));
    }

    /// Notes contents that are not read.
    pub fn note(&mut self, note: String) {
        self.notes.push(note);
    }

    /// Counts values before they are read.
    ///
    /// # Errors
    /// A reason if the container holds more values than any record has.
    pub fn reserve(&mut self, n: usize) -> Result<(), String> {
        self.n_values = self.n_values.saturating_add(n);
        if self.n_values > MOST_VALUES {
            return Err(format!("it holds more than {MOST_VALUES} values"));
        }
        Ok(())
    }

    /// Writes all tables as text. A vector without a partner of its length is noted.
    pub fn into_text(self) -> TableText {
        let mut tables = self.matrices;
        let mut notes = self.notes;
        for (group, by_length) in self.groups {
            for (length, columns) in by_length {
                match columns.as_slice() {
                    [(name, _)] => notes.push(format!(
                        "`{}` is not read: it is the only vector of {length} values in its group",
                        join_path(&group, name)
                    )),
                    _ => tables.push((group.clone(), columns)),
                }
            }
        }
        let mut text = TableText { notes, ..TableText::default() };
        if !tables.is_empty() {
            for scalar in &self.scalars {
                text.title(scalar);
            }
        }
        for (title, columns) in tables {
            text.title(if title.is_empty() { "table" } else { &title });
            let n_rows = columns.iter().map(|(_, values)| values.len()).max().unwrap_or(0);
            text.row(columns.iter().map(|(name, _)| name.clone()));
            for row in 0..n_rows {
                text.row(columns.iter().map(|(_, values)| values.get(row).copied().map_or(String::new(), number)));
            }
        }
        text
    }
}

/// Path of an item in a group; the top group has an empty name.
pub fn join_path(group: &str, name: &str) -> String {
    if group.is_empty() { name.to_string() } else { format!("{group}.{name}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_every_type_are_decoded() {
        let of = |kind, size, is_big_endian| NumberType { kind, size, is_big_endian };
        assert_eq!(of(NumberKind::Float, 8, true).decode(&1.5_f64.to_be_bytes()), Some(1.5));
        assert_eq!(of(NumberKind::Float, 4, false).decode(&(-2.5_f32).to_le_bytes()), Some(-2.5));
        assert_eq!(of(NumberKind::Signed, 2, true).decode(&(-300_i16).to_be_bytes()), Some(-300.0));
        assert_eq!(of(NumberKind::Signed, 8, false).decode(&(-1_i64).to_le_bytes()), Some(-1.0));
        assert_eq!(of(NumberKind::Unsigned, 1, false).decode(&[200]), Some(200.0));
        assert_eq!(of(NumberKind::Float, 2, false).decode(&[0, 0]), None);
        assert_eq!(of(NumberKind::Float, 8, false).decode(&[0; 7]), None);
        assert_eq!(of(NumberKind::Signed, 9, false).decode(&[0; 9]), None);
    }

    #[test]
    fn vectors_of_equal_length_form_a_table_and_others_are_noted() {
        let mut arrays = Arrays::default();
        arrays.add("run", "t", &[1, 4], vec![0.0, 1.0, 2.0, 3.0]);
        arrays.add("run", "x", &[4, 1], vec![0.0, 2.0, f64::NAN, 6.0]);
        arrays.add("run", "calibration", &[5], vec![1.0; 5]);
        arrays.add("", "m", &[2, 3], vec![1.0, 10.0, 2.0, 20.0, 3.0, 30.0]);
        arrays.add("", "k", &[1, 1], vec![0.5]);
        arrays.add("", "cube", &[2, 2, 2], vec![0.0; 8]);
        let TableText { text, notes } = arrays.into_text();
        assert_eq!(text, "k: 0.5\n\nm\ncolumn 1\tcolumn 2\n1\t10\n2\t20\n3\t30\n\nrun\nt\tx\n0\t0\n1\t2\n2\t\n3\t6\n");
        assert_eq!(notes.len(), 2, "{notes:?}");
        assert!(notes[0].contains("`cube`") && notes[1].contains("`run.calibration`"), "{notes:?}");
    }
}
