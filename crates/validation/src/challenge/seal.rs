//! Seals an answer, so that it can be opened later but any change is detected.
//!
//! The commitment is the SHA-256 hash of salt and answer. The answer is stored beside it, masked with a SHA-256 stream of the salt, so that nobody reads it by
//! accident. Anyone can open the seal. It protects against accidental reading and later changes, not against an attack.

use serde::{Deserialize, Serialize};

use base::sha256::{Hash, hex, sha256_hex};

/// Number of bytes of a salt.
pub const SALT_BYTES: usize = 32;

/// A sealed answer, as it is stored in a file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Sealed {
    /// Name of the schema, `vitreo-uq/sealed/1`.
    pub schema: String,
    /// SHA-256 hash of salt and answer, in hexadecimal digits.
    pub commitment_sha256: String,
    /// Salt, in hexadecimal digits.
    pub salt: String,
    /// Masked answer, in hexadecimal digits.
    pub answer: String,
}

/// Schema name of a sealed answer's document.
pub const SCHEMA: &str = "vitreo-uq/sealed/1";

/// SHA-256 hash of salt and answer, in hexadecimal digits.
pub fn commitment_sha256(salt: &[u8], answer: &[u8]) -> String {
    sha256_hex(&[salt, answer].concat())
}

/// Seals an answer with a salt.
pub fn seal(salt: &[u8; SALT_BYTES], answer: &[u8]) -> Sealed {
    Sealed {
        schema: SCHEMA.into(),
        commitment_sha256: commitment_sha256(salt, answer),
        salt: hex(salt),
        answer: hex(&mask(salt, answer)),
    }
}

/// Opens a sealed answer. Returns `None` if the answer is damaged or does not match its commitment (the hash that was published first).
pub fn open(sealed: &Sealed) -> Option<Vec<u8>> {
    let (salt, bytes) = (from_hex(&sealed.salt)?, from_hex(&sealed.answer)?);
    let answer = mask(&salt, &bytes);
    (commitment_sha256(&salt, &answer) == sealed.commitment_sha256).then_some(answer)
}

/// Combines each byte (exclusive or) with a byte of the SHA-256 hashes of salt and block number. Applied twice, it restores the bytes.
fn mask(salt: &[u8], bytes: &[u8]) -> Vec<u8> {
    let mut out = Vec::with_capacity(bytes.len());
    for (number, block) in (0_u64..).zip(bytes.chunks(32)) {
        let mask = Hash::hash(&[salt, &number.to_le_bytes()].concat());
        out.extend(block.iter().zip(mask.iter()).map(|(a, b)| a ^ b));
    }
    out
}

fn from_hex(text: &str) -> Option<Vec<u8>> {
    let (pairs, []) = text.as_bytes().as_chunks::<2>() else { return None };
    pairs.iter().map(|pair| u8::from_str_radix(std::str::from_utf8(pair).ok()?, 16).ok()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SALT: [u8; SALT_BYTES] = [7; SALT_BYTES];

    #[test]
    fn what_is_sealed_can_be_opened_and_not_read() {
        let answer = b"softening softening softening softening softening softening";
        let sealed = seal(&SALT, answer);
        assert_eq!(open(&sealed).as_deref(), Some(&answer[..]));
        assert!(!serde_json::to_string(&sealed).unwrap().contains("softening"));
        assert!(!sealed.answer.contains(&hex(b"softening")));
        assert_eq!(sealed.commitment_sha256, sha256_hex(&[&SALT[..], answer].concat()));
    }

    #[test]
    fn a_changed_answer_does_not_open() {
        let sealed = seal(&SALT, b"softening");
        for changed in [
            Sealed { answer: seal(&SALT, b"force-bias").answer, ..sealed.clone() },
            Sealed { salt: hex(&[8; SALT_BYTES]), ..sealed.clone() },
            Sealed { answer: "no hex".into(), ..sealed.clone() },
            Sealed { answer: "abc".into(), ..sealed.clone() },
        ] {
            assert_eq!(open(&changed), None);
        }
    }
}
