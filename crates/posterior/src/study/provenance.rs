//! Header that states the origin of a JSON document: schema, program version, seed and inputs (formats §3).

use std::collections::BTreeMap;

use base::sha256::sha256_hex;
use serde::{Deserialize, Serialize};

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
}

impl Provenance {
    /// Creates a header with the version of this program and the schema `vitreo-uq/<kind>/<number>`.
    pub fn new(kind: &str, number: u32, seed: u64, inputs_sha256: BTreeMap<String, String>) -> Self {
        let version = env!("CARGO_PKG_VERSION").to_string();
        Self { schema: format!("vitreo-uq/{kind}/{number}"), version, seed, inputs_sha256 }
    }

    /// Adds the hash of a further input file, such as a prior file.
    pub fn with_input(mut self, name: impl Into<String>, bytes: &[u8]) -> Self {
        self.inputs_sha256.insert(name.into(), sha256_hex(bytes));
        self
    }
}

/// A JSON document that consists of a header and a body. The keys of both are at the top level.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schemas", derive(schemars::JsonSchema))]
pub struct WithProvenance<T> {
    /// Header with the document's origin.
    #[serde(flatten)]
    pub provenance: Provenance,
    /// Body: a struct or map without the header's keys.
    #[serde(flatten)]
    pub body: T,
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
