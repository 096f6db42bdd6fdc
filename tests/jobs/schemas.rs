//! The JSON Schemas in the repository match the Rust types.

use serde_json::Value;

use vitreo_uq::documents::posterior::ParameterSummary;
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

/// Diagnostics of draws without variation are undefined, which JSON writes as null. The document is read again.
#[test]
fn undefined_diagnostics_are_read_again() {
    for rhat in [f64::NAN, 1.0] {
        let summary = ParameterSummary {
            name: "young_modulus_pa".into(),
            mean: 3.0,
            sd: 0.0,
            q05: 3.0,
            median: 3.0,
            q95: 3.0,
            ess_bulk: rhat,
            ess_tail: rhat,
            rhat,
            mcse_mean: rhat,
            surrogate_bias_sd: None,
            discretisation_bias_sd: None,
        };
        let text = serde_json::to_string(&summary).expect("JSON");
        let read: ParameterSummary = serde_json::from_str(&text).expect("a summary");
        let diagnostics = [read.ess_bulk, read.ess_tail, read.rhat, read.mcse_mean];
        assert!(diagnostics.iter().all(|read| read.is_nan() == rhat.is_nan()), "{text}");
    }
}
