//! Arrays of NumPy: one array (.npy), plain or structured, and archives of arrays (.npz).
//!
//! Source: NEP 1, "A Simple File Format for NumPy Arrays", and its versions 2 and 3.

use std::io::{Cursor, Read};

use crate::arrays::{Arrays, MOST_VALUES, NumberKind, NumberType};
use crate::refused::{IS_ZIP, zip_entries};
use crate::table_text::TableText;

const IS_ARRAY: &[u8] = b"\x93NUMPY";

pub fn recognises_array(bytes: &[u8]) -> bool {
    bytes.starts_with(IS_ARRAY)
}

pub fn recognises_archive(bytes: &[u8]) -> bool {
    bytes.starts_with(IS_ZIP) && zip_entries(bytes).0.iter().any(|name| name.ends_with(".npy"))
}

pub fn read_array(bytes: &[u8]) -> Result<TableText, String> {
    let mut arrays = Arrays::default();
    add(&mut arrays, "array", bytes)?;
    Ok(arrays.into_text())
}

pub fn read_archive(bytes: &[u8]) -> Result<TableText, String> {
    let mut archive = zip::ZipArchive::new(Cursor::new(bytes)).map_err(|error| error.to_string())?;
    let mut arrays = Arrays::default();
    for place in 0..archive.len() {
        let part = archive.by_index(place).map_err(|error| error.to_string())?;
        let Some(name) = part.name().ok().and_then(|name| Some(name.strip_suffix(".npy")?.to_string())) else {
            continue;
        };
        let mut array = Vec::new();
        part.take(8 * MOST_VALUES as u64).read_to_end(&mut array).map_err(|error| error.to_string())?;
        if let Err(why) = add(&mut arrays, &name, &array) {
            arrays.note(format!("`{name}` is not read: {why}"));
        }
    }
    Ok(arrays.into_text())
}

/// Field of an array's elements: its name, place in bytes, and type.
type Field = (String, usize, NumberType);

fn add(arrays: &mut Arrays, name: &str, bytes: &[u8]) -> Result<(), String> {
    let (header, data) = split(bytes).ok_or("the header is incomplete")?;
    let shape: Vec<usize> = value_of(header, "shape")
        .and_then(|text| {
            text.trim_matches(['(', ')'])
                .split(',')
                .map(str::trim)
                .filter(|n| !n.is_empty())
                .map(|n| n.parse().ok())
                .collect()
        })
        .ok_or("the header has no shape")?;
    let n = shape.iter().try_fold(1_usize, |n, length| n.checked_mul(*length)).ok_or("the array is too large")?;
    let described = value_of(header, "descr").ok_or("the header has no type")?;
    let (fields, size) = fields(described).ok_or_else(|| format!("its values of type {described} are no numbers"))?;
    arrays.reserve(n.saturating_mul(fields.len()))?;
    let data = data.get(..n.checked_mul(size).ok_or("the array is too large")?).ok_or("the data end early")?;
    let column = |place: usize, kind: NumberType| {
        let values = kind.decode_all(data, size, place);
        values.ok_or_else(|| format!("its values of type {described} are not supported"))
    };
    if let [(field, place, kind)] = fields.as_slice()
        && field.is_empty()
    {
        let values = column(*place, *kind)?;
        match value_of(header, "fortran_order") {
            Some("True") => arrays.add("", name, &shape, values),
            _ => arrays.add_row_major("", name, &shape, values),
        }
        return Ok(());
    }
    let columns = fields.iter().map(|(field, place, kind)| Ok((field.clone(), column(*place, *kind)?)));
    arrays.add_table(name, columns.collect::<Result<_, String>>()?);
    Ok(())
}

/// Splits an array into the text of its header and its data.
fn split(bytes: &[u8]) -> Option<(&str, &[u8])> {
    let rest = bytes.strip_prefix(IS_ARRAY)?;
    let (major, rest) = (*rest.first()?, rest.get(2..)?);
    let (length, rest) = match major {
        1 => (usize::from(u16::from_le_bytes(rest.get(..2)?.try_into().ok()?)), &rest[2..]),
        _ => (u32::from_le_bytes(rest.get(..4)?.try_into().ok()?) as usize, &rest[4..]),
    };
    let (header, data) = rest.split_at_checked(length)?;
    Some((std::str::from_utf8(header).ok()?, data))
}

/// Text of a key's value in the header, which is a Python dictionary.
fn value_of<'a>(header: &'a str, key: &str) -> Option<&'a str> {
    let rest = header.split_once(&format!("'{key}':"))?.1.trim_start();
    let mut depth = 0_i32;
    let end = rest.find(|c| {
        depth += i32::from(matches!(c, '(' | '[')) - i32::from(matches!(c, ')' | ']'));
        depth <= 0 && matches!(c, ',' | '}')
    })?;
    Some(rest[..end].trim())
}

/// Fields of an array's elements and the size of an element in bytes. A plain array has one field without a name. `None` if a field is no number.
fn fields(described: &str) -> Option<(Vec<Field>, usize)> {
    let Some(list) = described.strip_prefix('[') else {
        let kind = number_type(described.trim_matches('\''))?;
        return Some((vec![(String::new(), 0, kind)], kind.size));
    };
    let (mut fields, mut place) = (Vec::new(), 0);
    for field in list.trim_end_matches(']').split('(').filter(|field| field.contains('\'')) {
        let mut words = field.split('\'').skip(1).step_by(2);
        let (name, kind) = (words.next()?, number_type(words.next()?)?);
        fields.push((name.to_string(), place, kind));
        place += kind.size;
    }
    Some((fields, place))
}

fn number_type(text: &str) -> Option<NumberType> {
    let kind = text.trim_start_matches(['<', '>', '|', '=']);
    let size = kind.get(1..)?.parse().ok()?;
    let kind = match kind.get(..1)? {
        "f" => NumberKind::Float,
        "i" => NumberKind::Signed,
        "u" | "b" => NumberKind::Unsigned,
        _ => return None,
    };
    Some(NumberType { kind, size, is_big_endian: text.starts_with('>') })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn array(header: &str, data: &[u8]) -> Vec<u8> {
        [IS_ARRAY, &[1, 0], &u16::try_from(header.len()).unwrap().to_le_bytes(), header.as_bytes(), data].concat()
    }

    #[test]
    fn rows_of_a_matrix_stay_rows_in_either_order() {
        let values = |order: [i32; 6]| order.iter().flat_map(|x| x.to_be_bytes()).collect::<Vec<u8>>();
        let header = |order: &str| format!("{{'descr': '>i4', 'fortran_order': {order}, 'shape': (3, 2), }}\n");
        for (order, data) in [("False", [1, 10, 2, 20, 3, 30]), ("True", [1, 2, 3, 10, 20, 30])] {
            let read = read_array(&array(&header(order), &values(data))).unwrap();
            assert_eq!(read.text, "array\ncolumn 1\tcolumn 2\n1\t10\n2\t20\n3\t30\n", "{order}");
        }
    }

    #[test]
    fn fields_of_a_structured_array_are_columns() {
        let data: Vec<u8> = (0..3_u8).flat_map(|i| [&f64::from(i).to_le_bytes()[..], &[i]].concat()).collect();
        let header = "{'descr': [('t', '<f8'), ('cycle', '|u1')], 'fortran_order': False, 'shape': (3,), }\n";
        assert_eq!(read_array(&array(header, &data)).unwrap().text, "array\nt\tcycle\n0\t0\n1\t1\n2\t2\n");
    }

    #[test]
    fn damaged_arrays_are_refused() {
        let header = "{'descr': '<f8', 'fortran_order': False, 'shape': (3,), }\n";
        assert!(read_array(&array(header, &[0; 23])).unwrap_err().contains("end early"));
        let huge = header.replace("(3,)", "(99999999999, 99999999999)");
        assert!(read_array(&array(&huge, &[])).unwrap_err().contains("too large"));
        assert!(read_array(&array(&header.replace("<f8", "<U8"), &[0; 99])).unwrap_err().contains("no numbers"));
        assert!(read_array(&array(header, &[0; 24])[..20]).is_err_and(|why| why.contains("header")));
    }
}
