//! MATLAB files of versions 5 to 7. Version 7.3 is HDF5.
//!
//! Source: MathWorks, "MAT-File Format", version 5. Numeric arrays are read, also those in structures and cells. Other crates read no structures, which
//! laboratories use most, or are new and large.

use std::io::Read;

use crate::arrays::{Arrays, MOST_VALUES, NumberKind, NumberType, join_path};
use crate::table_text::TableText;

/// Length of the file's header in bytes.
const HEADER: usize = 128;
/// Types of data elements.
const MATRIX: u32 = 14;
const COMPRESSED: u32 = 15;
/// Largest depth of structures in structures.
const DEEPEST: usize = 16;

pub fn recognises(bytes: &[u8]) -> bool {
    bytes.starts_with(b"MATLAB 5.0") && matches!(bytes.get(126..HEADER), Some(b"IM" | b"MI"))
}

pub fn read(bytes: &[u8]) -> Result<TableText, String> {
    let elements =
        Elements { rest: bytes.get(HEADER..).unwrap_or_default(), is_big_endian: bytes.get(126) == Some(&b'M') };
    let mut arrays = Arrays::default();
    add_all(elements, true, &mut arrays)?;
    Ok(arrays.into_text())
}

/// Adds all matrices. Compressed elements hold matrices alone, so they are not unpacked inside each other.
fn add_all(mut elements: Elements<'_>, may_unpack: bool, arrays: &mut Arrays) -> Result<(), String> {
    while let Some((kind, data)) = elements.next()? {
        match kind {
            MATRIX => add(Elements { rest: data, ..elements }, "", None, DEEPEST, arrays)?,
            COMPRESSED if may_unpack => {
                let mut plain = Vec::new();
                let mut unpacked = flate2::read::ZlibDecoder::new(data).take(8 * MOST_VALUES as u64);
                unpacked.read_to_end(&mut plain).map_err(|error| error.to_string())?;
                add_all(Elements { rest: &plain, ..elements }, false, arrays)?;
            }
            _ => {}
        }
    }
    Ok(())
}

/// Adds a matrix with its name. Elements of structures and cells have their `name` from outside.
fn add(
    mut parts: Elements<'_>,
    group: &str,
    name: Option<&str>,
    depth: usize,
    arrays: &mut Arrays,
) -> Result<(), String> {
    // An empty element stands for an empty array.
    if parts.rest.is_empty() {
        return Ok(());
    }
    let flags = parts.numbers()?;
    let class = flags.first().map_or(0, |flags| *flags as u32 & 0xff);
    if class == 17 {
        arrays.note(format!(
            "`{}` is a MATLAB object such as a table: store its columns as vectors",
            join_path(group, name.unwrap_or("an object"))
        ));
        return Ok(());
    }
    let shape: Vec<usize> = parts.numbers()?.iter().map(|n| *n as usize).collect();
    let own = parts.text()?;
    let name = name.unwrap_or(&own);
    match class {
        // Cells.
        1 if depth > 0 => {
            let mut number = 0;
            while let Some((kind, data)) = parts.next()? {
                number += 1;
                if kind == MATRIX {
                    add(
                        Elements { rest: data, ..parts },
                        &join_path(group, name),
                        Some(&format!("cell {number}")),
                        depth - 1,
                        arrays,
                    )?;
                }
            }
        }
        // Structures: one matrix for each field of each element.
        2 if depth > 0 => {
            let length = parts.numbers()?.first().map_or(0, |n| *n as usize);
            let names = parts.text_of_fields(length)?;
            let n_elements: usize = shape.iter().fold(1, |n, length| n.saturating_mul(*length));
            for place in 0.. {
                let Some((kind, data)) = parts.next()? else { break };
                let (Some(field), element) = (names.get(place % names.len().max(1)), place / names.len().max(1)) else {
                    break;
                };
                let path = join_path(group, name);
                let path = if n_elements > 1 { format!("{path}({})", element + 1) } else { path };
                if kind == MATRIX {
                    add(Elements { rest: data, ..parts }, &path, Some(field), depth - 1, arrays)?;
                }
            }
        }
        6..=15 => {
            let n =
                shape.iter().try_fold(1_usize, |n, length| n.checked_mul(*length)).ok_or("an array is too large")?;
            arrays.reserve(n)?;
            let values = parts.numbers()?;
            if values.len() != n {
                return Err(format!("`{name}` has {} of {n} values", values.len()));
            }
            arrays.add(group, name, &shape, values);
        }
        _ => {}
    }
    Ok(())
}

/// Data elements that follow each other in a block of bytes.
#[derive(Debug, Clone, Copy)]
struct Elements<'a> {
    rest: &'a [u8],
    is_big_endian: bool,
}

impl<'a> Elements<'a> {
    /// Type and data of the next element; `None` at the end.
    fn next(&mut self) -> Result<Option<(u32, &'a [u8])>, String> {
        if self.rest.len() < 8 {
            return Ok(None);
        }
        let unsigned = NumberType { kind: NumberKind::Unsigned, size: 4, is_big_endian: self.is_big_endian };
        let word =
            |at: usize| self.rest.get(at..).and_then(|bytes| unsigned.decode(bytes)).map_or(0, |word| word as u32);
        // A small element keeps its length and its data in the first eight bytes.
        let (kind, length, start) = match word(0) {
            small if small > 0xffff => (small & 0xffff, (small >> 16) as usize, 4),
            kind => (kind, word(4) as usize, 8),
        };
        let data = self.rest.get(start..start + length).ok_or("an element ends after the end of the file")?;
        // Elements begin at multiples of eight bytes, except after compressed ones.
        let end = if start == 4 {
            8
        } else if kind == COMPRESSED {
            start + length
        } else {
            start + length.next_multiple_of(8)
        };
        self.rest = self.rest.get(end..).unwrap_or_default();
        Ok(Some((kind, data)))
    }

    /// Numbers of the next element.
    fn numbers(&mut self) -> Result<Vec<f64>, String> {
        let Some((kind, data)) = self.next()? else { return Ok(Vec::new()) };
        let (kind, size) = match kind {
            1 => (NumberKind::Signed, 1),
            2 => (NumberKind::Unsigned, 1),
            3 => (NumberKind::Signed, 2),
            4 => (NumberKind::Unsigned, 2),
            5 => (NumberKind::Signed, 4),
            6 => (NumberKind::Unsigned, 4),
            7 => (NumberKind::Float, 4),
            9 => (NumberKind::Float, 8),
            12 => (NumberKind::Signed, 8),
            13 => (NumberKind::Unsigned, 8),
            other => return Err(format!("an element has the unknown type {other}")),
        };
        NumberType { kind, size, is_big_endian: self.is_big_endian }
            .decode_all(data, size, 0)
            .ok_or_else(|| "an element ends early".into())
    }

    /// Text of the next element.
    fn text(&mut self) -> Result<String, String> {
        Ok(self.next()?.map_or(String::new(), |(_, data)| String::from_utf8_lossy(data).into_owned()))
    }

    /// Names of a structure's fields: texts of equal `length`, each ended by a zero byte.
    fn text_of_fields(&mut self, length: usize) -> Result<Vec<String>, String> {
        let Some((_, data)) = self.next()? else { return Ok(Vec::new()) };
        let name = |bytes: &[u8]| String::from_utf8_lossy(bytes).trim_end_matches('\0').to_string();
        Ok(data.chunks(length.max(1)).map(name).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::Elements;

    /// Checks every type of numbers against the bytes of its first value; small elements and long ones, in both orders of bytes.
    #[test]
    fn numbers_of_every_type_are_decoded() {
        let kinds: [(u32, f64, &[u8]); 10] = [
            (1, -2.0, &[0xfe]),
            (2, 254.0, &[0xfe]),
            (3, -2.0, &[0xfe, 0xff]),
            (4, 65_534.0, &[0xfe, 0xff]),
            (5, -2.0, &[0xfe, 0xff, 0xff, 0xff]),
            (6, 4_294_967_294.0, &[0xfe, 0xff, 0xff, 0xff]),
            (7, -2.0, &[0, 0, 0, 0xc0]),
            (9, -2.0, &[0, 0, 0, 0, 0, 0, 0, 0xc0]),
            (12, -2.0, &[0xfe, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff]),
            (13, 256.0, &[0, 1, 0, 0, 0, 0, 0, 0]),
        ];
        for (kind, value, bytes) in kinds {
            for (is_big_endian, n) in [(false, 1), (true, 1), (false, 9), (true, 9)] {
                let ordered = |bytes: &[u8]| match is_big_endian {
                    true => bytes.iter().rev().copied().collect::<Vec<u8>>(),
                    false => bytes.to_vec(),
                };
                let data = ordered(bytes).repeat(n);
                let mut element = match data.len() {
                    small @ ..=4 => ordered(&(kind | (small as u32) << 16).to_le_bytes()),
                    long => [kind, long as u32].iter().flat_map(|word| ordered(&word.to_le_bytes())).collect(),
                };
                element.extend(data);
                element.resize(element.len().next_multiple_of(8), 0);
                let numbers = Elements { rest: &element, is_big_endian }.numbers().expect("an element");
                assert_eq!(numbers, vec![value; n], "type {kind}, big-endian: {is_big_endian}");
            }
        }
        let unknown = Elements { rest: &[99, 0, 0, 0, 0, 0, 0, 0], is_big_endian: false }.numbers();
        assert!(unknown.expect_err("type 99").contains("unknown type 99"));
    }
}
