//! The JSON Schemas in the repository match the Rust types.

use serde_json::Value;

use vitreo_uq::jobs::schemas::all;

/// The files in the repository are up to date.
#[test]
fn files_are_up_to_date() {
    let dir = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/schemas");
    for document_schema in all() {
        let file = dir.join(document_schema.file_name());
        let text = std::fs::read_to_string(&file).unwrap_or_default();
        assert!(text == document_schema.text(), "{} is out of date: cargo run --example write_schemas", file.display());
    }
    assert_eq!(std::fs::read_dir(dir).unwrap().count(), all().len());
}

/// Keys of the header and of the body are in one object, and both are required.
#[test]
fn headers_and_bodies_are_one_object() {
    for document_schema in all() {
        let required: Vec<&str> =
            document_schema.schema["required"].as_array().unwrap().iter().filter_map(Value::as_str).collect();
        for key in ["schema", "version", "seed", "inputs_sha256"] {
            assert!(
                required.contains(&key) && document_schema.schema["properties"][key].is_object(),
                "{}: {key}",
                document_schema.kind
            );
        }
        assert!(required.len() > 6, "{}: {required:?}", document_schema.kind);
        assert_eq!(
            document_schema.schema["properties"]["schema"]["const"],
            format!("vitreo-uq/{}/1", document_schema.kind)
        );
    }
}
