//! Header that states the origin of a JSON document: schema, program version, seed and inputs (formats §3).

use std::collections::BTreeMap;

use base::quantities::Quantities;
use base::sha256::sha256_hex;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::Value;

/// Header of a JSON document. Its keys are at the top level of the document.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct Provenance {
    /// Schema of the document: `vitreo-uq/<kind>/<number>`.
    pub schema: String,
    /// Version of the program that wrote the document.
    pub version: String,
    /// Seed of all random streams.
    pub seed: u64,
    /// SHA-256 of each input, in hexadecimal, by file name.
    pub inputs_sha256: BTreeMap<String, String>,
    /// Words and units of the record's quantities: `relaxation`, `stress-creep` or `stress-relaxation`. Absent for a commanded force and a measured position.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub record_kind: Option<String>,
}

impl Provenance {
    /// Creates a header with the version of this program and the schema `vitreo-uq/<kind>/<number>`.
    pub fn new(kind: &str, number: u32, seed: u64, inputs_sha256: BTreeMap<String, String>) -> Self {
        let version = env!("CARGO_PKG_VERSION").to_string();
        Self { schema: format!("vitreo-uq/{kind}/{number}"), version, seed, inputs_sha256, record_kind: None }
    }

    /// Adds the words and units of the record's quantities.
    pub fn with_quantities(mut self, quantities: Option<Quantities>) -> Self {
        self.record_kind = quantities.map(|quantities| quantities.name().to_string());
        self
    }

    fn quantities(&self) -> Option<Quantities> {
        self.record_kind.as_deref().and_then(Quantities::named)
    }

    /// Adds the hash of a further input file, such as a prior file.
    pub fn with_input(mut self, name: impl Into<String>, bytes: &[u8]) -> Self {
        self.inputs_sha256.insert(name.into(), sha256_hex(bytes));
        self
    }

    /// Adds the hashes of further inputs.
    pub fn with_hashes(mut self, hashes: impl IntoIterator<Item = (String, String)>) -> Self {
        self.inputs_sha256.extend(hashes);
        self
    }
}

/// A JSON document that consists of a header and a body. The keys of both are at the top level. For records with other quantities than a commanded force and a
/// measured position, sentences and keys are translated as the document is written. The document then also holds its original under [`ORIGINAL`], which is read.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct WithProvenance<T> {
    /// Header with the document's origin.
    #[cfg_attr(feature = "schemas", schemars(flatten))]
    pub provenance: Provenance,
    /// Body: a struct or map without the header's keys.
    #[cfg_attr(feature = "schemas", schemars(flatten))]
    pub body: T,
}

/// Key of a translated document's original, in which the words force and position, and keys with `_um`, stand for the other quantities of the record.
pub const ORIGINAL: &str = "original";

/// Keys of header and body at one level, for reading and writing.
#[derive(Serialize, Deserialize)]
struct Flat<P, T> {
    #[serde(flatten)]
    provenance: P,
    #[serde(flatten)]
    body: T,
}

impl<T: Serialize> Serialize for WithProvenance<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        let flat = Flat { provenance: &self.provenance, body: &self.body };
        match self.provenance.quantities() {
            None => flat.serialize(serializer),
            Some(quantities) => {
                let original = serde_json::to_value(flat).map_err(serde::ser::Error::custom)?;
                let mut document = quantities.translate_document(original.clone());
                document[ORIGINAL] = original;
                document.serialize(serializer)
            }
        }
    }
}

impl<'de, T: DeserializeOwned> Deserialize<'de> for WithProvenance<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        let mut document = Value::deserialize(deserializer)?;
        if let Some(original) = document.get_mut(ORIGINAL) {
            document = original.take();
        }
        let flat: Flat<Provenance, T> = serde_json::from_value(document).map_err(serde::de::Error::custom)?;
        Ok(Self { provenance: flat.provenance, body: flat.body })
    }
}

/// Content of a file that the program keeps for later use, with its hash. If the hash shows that the file was changed, the content is computed again.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Kept<T> {
    content_sha256: String,
    #[serde(flatten)]
    content: T,
}

impl<T: Serialize> Kept<T> {
    /// Creates the file's content with its hash.
    pub fn new(content: T) -> Self {
        Self { content_sha256: Self::hash(&content), content }
    }

    /// Returns the content if its hash is correct, and `None` if the file was changed.
    pub fn unchanged(self) -> Option<T> {
        (self.content_sha256 == Self::hash(&self.content)).then_some(self.content)
    }

    /// SHA-256 of the content's JSON text. Floating-point values are read back exactly, so content that was read has an identical text. The hash is empty if the
    /// content cannot be written.
    fn hash(content: &T) -> String {
        serde_json::to_vec(content).map_or_else(|_| String::new(), |bytes| sha256_hex(&bytes))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_kept_comes_back_unless_it_was_changed() {
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
        struct Body {
            modes: usize,
            values: Vec<f64>,
        }
        let body = Body { modes: 1, values: vec![0.1 + 0.2, -0.0, 1.0, 1e-300, 1e300] };
        let text = serde_json::to_string(&Kept::new(body.clone())).unwrap();
        let read = |text: &str| serde_json::from_str::<Kept<Body>>(text).unwrap().unchanged();
        assert_eq!(read(&text), Some(body));
        assert_eq!(read(&text.replace("\"modes\":1", "\"modes\":2")), None);
        assert_eq!(read(&text.replace("0.30000000000000004", "0.3")), None);
    }

    #[test]
    fn the_header_is_flat_and_reads_back() {
        #[derive(Debug, PartialEq, Serialize, Deserialize)]
        struct Body {
            rmse_um: f64,
        }
        let provenance = Provenance::new("fit", 1, u64::MAX, BTreeMap::new()).with_input("a.toml", b"abc");
        let document = WithProvenance { provenance, body: Body { rmse_um: 0.1 + 0.2 } };
        let text = serde_json::to_string(&document).unwrap();
        let value: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!(value["schema"], "vitreo-uq/fit/1");
        assert_eq!(value["version"], env!("CARGO_PKG_VERSION"));
        assert_eq!(value["inputs_sha256"]["a.toml"], sha256_hex(b"abc"));
        assert_eq!(value["rmse_um"], 0.1 + 0.2);
        assert_eq!(serde_json::from_str::<WithProvenance<Body>>(&text).unwrap(), document);
    }
}
