//! HDF5 files, among them NetCDF 4, MATLAB 7.3 and exports of optical tweezers.

use hdf5_reader::group::Group;
use hdf5_reader::{ByteOrder, Dataset, Datatype, Hdf5File};

use crate::arrays::{Arrays, NumberKind, NumberType, join_path};
use crate::table_text::TableText;

const SIGNATURE: &[u8] = b"\x89HDF\r\n\x1a\n";
/// Places at which an HDF5 file may begin: MATLAB writes a text of 512 bytes before it.
const STARTS: [usize; 4] = [0, 512, 1024, 2048];
/// Largest depth of groups in groups. A link may lead back to a group above.
const DEEPEST: usize = 16;
/// Name of the column of times that is computed from a sampling rate.
const TIME: &str = "time [s]";

pub fn recognises(bytes: &[u8]) -> bool {
    STARTS.iter().any(|start| bytes.get(*start..).is_some_and(|rest| rest.starts_with(SIGNATURE)))
}

pub fn read(bytes: &[u8]) -> Result<TableText, String> {
    let file = Hdf5File::from_vec(bytes.to_vec()).map_err(|error| error.to_string())?;
    let root = file.root_group().map_err(|error| error.to_string())?;
    let mut arrays = Arrays::default();
    walk(&root, "", DEEPEST, &mut arrays)?;
    Ok(arrays.into_text())
}

fn walk(group: &Group, path: &str, depth: usize, arrays: &mut Arrays) -> Result<(), String> {
    let (groups, datasets) = group.members().map_err(|error| error.to_string())?;
    for dataset in &datasets {
        let name = dataset.name().rsplit('/').next().unwrap_or_default().to_string();
        if let Err(why) = add(dataset, path, &name, arrays) {
            arrays.note(format!("`{}` is not read: {why}", join_path(path, &name)));
        }
    }
    for group in groups {
        let name = group.name().rsplit('/').next().unwrap_or_default();
        // MATLAB keeps the contents of cells and objects in groups whose names begin with `#`.
        if depth > 0 && !name.starts_with('#') {
            walk(&group, &join_path(path, name), depth - 1, arrays)?;
        }
    }
    Ok(())
}

fn add(dataset: &Dataset, group: &str, name: &str, arrays: &mut Arrays) -> Result<(), String> {
    let fields = match dataset.dtype() {
        Datatype::Compound { fields, .. } => fields
            .iter()
            .filter_map(|field| Some((field.name.clone(), field.byte_offset as usize, number_type(&field.datatype)?)))
            .collect(),
        other => match number_type(other) {
            Some(kind) => vec![(String::new(), 0, kind)],
            None => return Ok(()),
        },
    };
    let n =
        usize::try_from(dataset.num_elements().map_err(|error| error.to_string())?).map_err(|_| "it is too large")?;
    arrays.reserve(n.saturating_mul(fields.len()))?;
    let size = dataset.raw_element_size().map_err(|error| error.to_string())?;
    let bytes = dataset.read_raw_bytes().map_err(|error| error.to_string())?;
    let column = |place: usize, kind: NumberType| {
        kind.decode_all(&bytes, size, place).ok_or_else(|| "its data end early".to_string())
    };
    if matches!(dataset.dtype(), Datatype::Compound { .. }) {
        let columns = fields.into_iter().map(|(field, place, kind)| {
            let values = column(place, kind)?;
            Ok(if field == "Timestamp" { (TIME.to_string(), since_first_s(&values)) } else { (field, values) })
        });
        let columns: Vec<_> = columns.collect::<Result<_, String>>()?;
        if columns.len() > 1 {
            arrays.add_table(&join_path(group, name), columns);
        }
        return Ok(());
    }
    let values = column(0, fields[0].2)?;
    let unit =
        ["units", "unit", "Units", "Unit"].iter().find_map(|key| dataset.attribute(key).ok()?.read_string().ok());
    let name = unit.filter(|unit| !unit.trim().is_empty()).map_or(name.to_string(), |unit| format!("{name} [{unit}]"));
    let rate_hz = dataset.attribute("Sample rate (Hz)").ok().and_then(|rate| rate.read_as_f64().ok());
    if let Some(rate_hz) = rate_hz.filter(|rate| *rate > 0.0)
        && !arrays.has_vector(group, TIME, values.len())
    {
        arrays.add_vector(group, TIME, (0..values.len()).map(|row| row as f64 / rate_hz).collect());
    }
    let shape: Vec<usize> = dataset.shape().iter().filter_map(|n| usize::try_from(*n).ok()).collect();
    arrays.add_row_major(group, &name, &shape, values);
    Ok(())
}

/// Times (s) since the first one, from times in ns.
fn since_first_s(times_ns: &[f64]) -> Vec<f64> {
    let first_ns = times_ns.first().copied().unwrap_or(0.0);
    times_ns.iter().map(|time_ns| 1e-9 * (time_ns - first_ns)).collect()
}

fn number_type(datatype: &Datatype) -> Option<NumberType> {
    let (kind, size, order) = match datatype {
        Datatype::FixedPoint { size, signed: true, byte_order } => (NumberKind::Signed, size, byte_order),
        Datatype::FixedPoint { size, signed: false, byte_order } => (NumberKind::Unsigned, size, byte_order),
        Datatype::FloatingPoint { size, byte_order } => (NumberKind::Float, size, byte_order),
        _ => return None,
    };
    Some(NumberType { kind, size: usize::from(*size), is_big_endian: *order == ByteOrder::BigEndian })
}
