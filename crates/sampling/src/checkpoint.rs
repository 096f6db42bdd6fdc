//! Checkpoint data of a sampling run: packing into bytes, and unpacking with checks for damage and for the right problem.

use base::error::{InputPlace, Setting};
use base::files::{self, Content};
use base::sha256::Hash;
use base::{Error, Result};
use std::path::Path;

const MAGIC: &[u8; 24] = b"vitreo-uq checkpoint 1\n\0";
const DIGEST_LENGTH: usize = 32;

/// Reads the bytes of a checkpoint file; `None` if the file does not exist.
///
/// # Errors
/// [`Error::File`] if the file cannot be read.
pub fn read(path: &Path) -> Result<Option<Vec<u8>>> {
    match files::read(path, Content::State, "check the file's permissions") {
        Ok(bytes) => Ok(Some(bytes)),
        Err(Error::File { source, .. }) if source.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error),
    }
}

/// Joins a header and numbers into one block of bytes with a checksum. The block holds the file signature, the hash of the problem, the lengths, the
/// contents and the SHA-256, in this order.
pub(super) fn pack(problem: &str, header: &str, numbers: &[&[f64]]) -> Vec<u8> {
    let count: usize = numbers.iter().map(|part| part.len()).sum();
    let mut bytes = Vec::with_capacity(MAGIC.len() + 3 * DIGEST_LENGTH + header.len() + 8 * count);
    bytes.extend_from_slice(MAGIC);
    bytes.extend_from_slice(&Hash::hash(problem.as_bytes()));
    bytes.extend_from_slice(&(header.len() as u64).to_le_bytes());
    bytes.extend_from_slice(&(count as u64).to_le_bytes());
    bytes.extend_from_slice(header.as_bytes());
    numbers.iter().flat_map(|part| part.iter()).for_each(|x| bytes.extend_from_slice(&x.to_le_bytes()));
    let digest = Hash::hash(&bytes);
    bytes.extend_from_slice(&digest);
    bytes
}

/// Splits a block of bytes from [`pack`] into its header and its numbers.
///
/// # Errors
/// [`Error::Input`] if the bytes are damaged or belong to another problem.
pub(super) fn unpack(problem: &str, bytes: &[u8]) -> Result<(String, Vec<f64>)> {
    let damaged =
        || refuse("the checkpoint is damaged or was written by another version", "delete it and start the run again");
    let (contents, digest) = bytes.split_last_chunk::<DIGEST_LENGTH>().ok_or_else(damaged)?;
    let after_magic = contents.strip_prefix(MAGIC.as_slice()).ok_or_else(damaged)?;
    if Hash::hash(contents)[..] != digest[..] {
        return Err(damaged());
    }
    let (hash, rest) = after_magic.split_first_chunk::<DIGEST_LENGTH>().ok_or_else(damaged)?;
    if Hash::hash(problem.as_bytes())[..] != hash[..] {
        return Err(refuse(
            "the checkpoint belongs to another problem (data, prior, model, seed, or sampler settings differ)",
            &format!(
                "resume with the inputs and options of the interrupted run, or start again without {}",
                Setting::Resume
            ),
        ));
    }
    let (header_length, rest) = rest.split_first_chunk::<8>().ok_or_else(damaged)?;
    let (count, rest) = rest.split_first_chunk::<8>().ok_or_else(damaged)?;
    let header_length = usize::try_from(u64::from_le_bytes(*header_length)).map_err(|_| damaged())?;
    let (header, numbers) = rest.split_at_checked(header_length).ok_or_else(damaged)?;
    if numbers.len() as u64 != u64::from_le_bytes(*count).saturating_mul(8) {
        return Err(damaged());
    }
    let header = String::from_utf8(header.to_vec()).map_err(|_| damaged())?;
    let (numbers, _) = numbers.as_chunks::<8>();
    Ok((header, numbers.iter().map(|chunk| f64::from_le_bytes(*chunk)).collect()))
}

/// Returns the error for an unusable checkpoint, with the fault and the remedy.
pub(super) fn refuse(found: &str, remedy: &str) -> Error {
    Error::input(InputPlace::setting(Setting::Resume), found, remedy)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn round_trip_keeps_every_bit() {
        let numbers = [1.0, -0.0, f64::MIN_POSITIVE, 0.1 + 0.2];
        let bytes = pack("p", "{\"a\":1}", &[&numbers[..1], &numbers[1..]]);
        let (header, found) = unpack("p", &bytes).unwrap();
        assert_eq!(header, "{\"a\":1}");
        assert!(found.iter().zip(numbers).all(|(a, b)| a.to_bits() == b.to_bits()));
    }

    #[test]
    fn damage_and_other_problems_are_refused() {
        let bytes = pack("p", "header", &[&[1.0, 2.0]]);
        assert!(unpack("q", &bytes).unwrap_err().to_string().contains("another problem"));
        for k in 0..bytes.len() {
            assert!(unpack("p", &bytes[..k]).is_err(), "cut at {k}");
            let mut flipped = bytes.clone();
            flipped[k] ^= 4;
            assert!(unpack("p", &flipped).is_err(), "flipped at {k}");
        }
    }

    #[test]
    fn a_missing_file_is_none_and_a_written_one_is_read_back() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("state");
        assert_eq!(read(&path).unwrap(), None);
        base::files::write_atomically(&path, b"first").unwrap();
        base::files::write_atomically(&path, b"second").unwrap();
        assert_eq!(read(&path).unwrap(), Some(b"second".to_vec()));
        assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 1);
    }
}
