//! Export of meshes and nodal fields as VTK unstructured grids (`.vtu`), and of time series as
//! ParaView collections (`.pvd`).
//!
//! The data arrays follow the XML text without compression (`AppendedData`, raw, little-endian,
//! 64-bit lengths). VTK since 5.10 and ParaView read this format.

use std::fmt::Write as _;
use std::path::Path;

use crate::mesh::{ElementKind, Mesh};
use base::error::{Error, InputPlace, Result};
use base::files::{stream_atomically, write_atomically, xml_text};

/// A field on the nodes of a mesh, for export.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointData<'a> {
    /// Name that ParaView shows, preferably with its unit (`displacement_m`).
    pub name: &'a str,
    /// Number of values per node: 1 for a scalar, 3 for a vector.
    pub components: usize,
    /// Values of the field: `components` per node, node after node.
    pub values: &'a [f64],
}

/// Entry of a time series: one file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimeStep<'a> {
    /// Time of the file's fields, in s.
    pub time_s: f64,
    /// Path of the `.vtu` file relative to the collection's folder, with `/` between folders.
    pub file: &'a str,
}

/// Number by which VTK identifies a type of element.
fn vtk_cell_type(kind: ElementKind) -> u8 {
    match kind {
        ElementKind::Hexahedron27 => 29,
        ElementKind::Tetrahedron10 => 24,
        ElementKind::Tetrahedron4 => 10,
    }
}

/// Writes a mesh (coordinates in m), with fields on its nodes, to a `.vtu` file. The file is
/// written completely or not at all.
///
/// # Errors
/// [`Error::Input`] if a field's length is not components × nodes, or if a field's name is empty or
/// repeated. [`Error::File`] if the file cannot be written.
pub fn write_vtu(path: impl AsRef<Path>, mesh: &Mesh, point_data: &[PointData<'_>]) -> Result<()> {
    let path = path.as_ref();
    check_fields(path, mesh, point_data)?;
    let mut arrays = Arrays::default();
    let points = mesh.node_coordinates_m.iter().flatten().flat_map(|value| value.to_le_bytes());
    let point_array = arrays.add("Float64", "points_m", 3, points);
    let connectivity =
        arrays.add("Int64", "connectivity", 1, mesh.connectivity.iter().flat_map(|&n| i64::from(n).to_le_bytes()));
    let ends = (1..=mesh.n_elements()).map(|k| (k * mesh.element_kind.n_nodes()) as i64);
    let offsets = arrays.add("Int64", "offsets", 1, ends.flat_map(i64::to_le_bytes));
    let types = std::iter::repeat_n(vtk_cell_type(mesh.element_kind), mesh.n_elements());
    let types = arrays.add("UInt8", "types", 1, types);
    let mut fields = String::new();
    for field in point_data {
        fields += &arrays.add(
            "Float64",
            field.name,
            field.components,
            field.values.iter().flat_map(|value| value.to_le_bytes()),
        );
    }
    let head = format!(
        "<?xml version=\"1.0\"?>\n\
         <VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n\
         <UnstructuredGrid>\n<Piece NumberOfPoints=\"{}\" NumberOfCells=\"{}\">\n<PointData>\n{fields}</PointData>\n\
         <Points>\n{point_array}</Points>\n<Cells>\n{connectivity}{offsets}{types}</Cells>\n</Piece>\n</UnstructuredGrid>\n\
         <AppendedData encoding=\"raw\">\n_",
        mesh.n_nodes(),
        mesh.n_elements(),
    );
    stream_atomically(path, |file| {
        file.write_all(head.as_bytes())?;
        file.write_all(&arrays.bytes)?;
        file.write_all(b"\n</AppendedData>\n</VTKFile>\n")
    })
}

/// Writes a ParaView collection that combines `.vtu` files into a time series. The file is written
/// completely or not at all.
///
/// # Errors
/// [`Error::Input`] if the times are not finite or do not increase. [`Error::File`] if the file
/// cannot be written.
pub fn write_pvd(path: impl AsRef<Path>, steps: &[TimeStep<'_>]) -> Result<()> {
    let path = path.as_ref();
    let increasing = steps.windows(2).all(|pair| pair[0].time_s < pair[1].time_s);
    if !increasing || steps.iter().any(|step| !step.time_s.is_finite()) {
        return Err(Error::input(
            InputPlace::file(path),
            "the time steps of the collection are not finite and increasing",
            "give the steps finite times, each later than the one before",
        ));
    }
    let mut text = "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"1.0\">\n<Collection>\n".to_owned();
    for TimeStep { time_s, file } in steps {
        let file = xml_text(file);
        let _ = writeln!(text, "<DataSet timestep=\"{time_s}\" group=\"\" part=\"0\" file=\"{file}\"/>");
    }
    text += "</Collection>\n</VTKFile>\n";
    write_atomically(path, text.as_bytes())
}

fn check_fields(path: &Path, mesh: &Mesh, point_data: &[PointData<'_>]) -> Result<()> {
    for (k, field) in point_data.iter().enumerate() {
        let place = || InputPlace::file(path).at_key(field.name);
        if field.components == 0 || field.values.len() != field.components * mesh.n_nodes() {
            return Err(Error::input(
                place(),
                format!(
                    "{} values instead of {} components on {} nodes",
                    field.values.len(),
                    field.components,
                    mesh.n_nodes()
                ),
                "give all components at every node, node after node",
            ));
        }
        if field.name.is_empty() || point_data[..k].iter().any(|other| other.name == field.name) {
            return Err(Error::input(
                place(),
                "the field has no name, or another field has its name",
                "give each field its own name",
            ));
        }
    }
    Ok(())
}

/// Data arrays that follow the XML text of a `.vtu` file.
#[derive(Default)]
struct Arrays {
    bytes: Vec<u8>,
}

impl Arrays {
    /// Appends a data array. Returns the XML element that refers to it.
    fn add(&mut self, kind: &str, name: &str, components: usize, content: impl Iterator<Item = u8>) -> String {
        let offset = self.bytes.len();
        self.bytes.extend([0; 8]);
        self.bytes.extend(content);
        let length = (self.bytes.len() - offset - 8) as u64;
        self.bytes[offset..offset + 8].copy_from_slice(&length.to_le_bytes());
        format!(
            "<DataArray type=\"{kind}\" Name=\"{}\" NumberOfComponents=\"{components}\" format=\"appended\" offset=\"{offset}\"/>\n",
            xml_text(name)
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one_tetrahedron() -> Mesh {
        Mesh {
            node_coordinates_m: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            element_kind: ElementKind::Tetrahedron4,
            connectivity: vec![0, 1, 2, 3],
            robot_nodes: vec![],
            outer_nodes: vec![],
            symmetry_y_nodes: vec![],
            symmetry_z_nodes: vec![],
        }
    }

    /// Finds the array `name` in a `.vtu` file. It uses the `offset` attribute, as a reader does.
    fn appended<'a>(file: &'a [u8], name: &str) -> &'a [u8] {
        let start = file.windows(2).position(|window| window == b"\n_").unwrap() + 2;
        let head = String::from_utf8_lossy(&file[..start]);
        let element = head.lines().find(|line| line.contains(&format!("Name=\"{name}\""))).unwrap();
        let offset: usize = element.split("offset=\"").nth(1).unwrap().split('"').next().unwrap().parse().unwrap();
        let at = start + offset;
        let length = u64::from_le_bytes(file[at..at + 8].try_into().unwrap()) as usize;
        &file[at + 8..at + 8 + length]
    }

    #[test]
    fn arrays_stand_where_their_offsets_say() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("one.vtu");
        let values = [1.5, -2.0, f64::MIN_POSITIVE, 1e300];
        let field = PointData { name: "a<b & \"c\"", components: 1, values: &values };
        write_vtu(&path, &one_tetrahedron(), &[field]).unwrap();
        let file = std::fs::read(&path).unwrap();
        let read: Vec<f64> = appended(&file, "a&lt;b &amp; &quot;c&quot;")
            .chunks_exact(8)
            .map(|bytes| f64::from_le_bytes(bytes.try_into().unwrap()))
            .collect();
        assert_eq!(read, values);
        assert_eq!(appended(&file, "types"), [10]);
        assert_eq!(appended(&file, "offsets"), 4_i64.to_le_bytes());
        assert_eq!(appended(&file, "points_m").len(), 4 * 3 * 8);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary file is left");
    }

    #[test]
    fn wrong_fields_are_refused_and_nothing_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("one.vtu");
        let short = PointData { name: "pressure_pa", components: 1, values: &[0.0; 3] };
        let error = write_vtu(&path, &one_tetrahedron(), &[short]).unwrap_err().to_string();
        assert!(error.contains("pressure_pa") && error.contains("3 values") && error.contains("4 nodes"), "{error}");
        let field = PointData { name: "pressure_pa", components: 1, values: &[0.0; 4] };
        let error = write_vtu(&path, &one_tetrahedron(), &[field, field]).unwrap_err().to_string();
        assert!(error.contains("its own name"), "{error}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[test]
    fn a_missing_folder_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("absent").join("one.vtu");
        let error = write_vtu(&path, &one_tetrahedron(), &[]).unwrap_err().to_string();
        assert!(error.contains("absent") && error.contains("directory exists"), "{error}");
    }

    #[test]
    fn a_collection_needs_increasing_times() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.pvd");
        let steps = [TimeStep { time_s: 0.0, file: "a.vtu" }, TimeStep { time_s: 0.25, file: "b.vtu" }];
        write_pvd(&path, &steps).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.contains("timestep=\"0.25\" group=\"\" part=\"0\" file=\"b.vtu\""), "{text}");
        for wrong in [&[steps[1], steps[0]][..], &[TimeStep { time_s: f64::NAN, file: "a.vtu" }]] {
            let error = write_pvd(&path, wrong).unwrap_err().to_string();
            assert!(error.contains("time steps of the collection are not finite and increasing"), "{error}");
        }
    }
}
