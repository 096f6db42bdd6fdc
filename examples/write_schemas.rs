//! Writes the JSON Schemas of all documents, by default to `docs/schemas/`: `cargo run --example write_schemas [-- DIR]`.

use std::path::PathBuf;

use vitreo_uq::base::files::write_atomically;

fn main() -> vitreo_uq::Result<()> {
    let default = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("docs/schemas");
    let dir = std::env::args_os().nth(1).map_or(default, PathBuf::from);
    let schemas = vitreo_uq::jobs::schemas::all();
    for document_schema in &schemas {
        write_atomically(&dir.join(document_schema.file_name()), document_schema.text().as_bytes())?;
    }
    println!("{} schemas in {}", schemas.len(), dir.display());
    Ok(())
}
