//! Hashes the sources of the whole program. The hash shows that results from several machines come from the same program.

use std::path::PathBuf;

/// The program's own sources, embedded data, and the versions of other crates.
const PROGRAM: [&str; 4] = ["src", "priors", "data/porcine-replica", "Cargo.lock"];

fn main() -> std::io::Result<()> {
    // Only the sources of the library's crates count: their tests change no result, and the Python module contains a built program.
    let mut crates = std::fs::read_dir("crates")?
        .map(|entry| entry.map(|entry| entry.path().join("src")))
        .collect::<std::io::Result<Vec<PathBuf>>>()?;
    crates.retain(|sources| !sources.starts_with("crates/python"));
    crates.sort();
    let places = crates.into_iter().chain(PROGRAM.map(PathBuf::from)).collect::<Vec<_>>();
    let hash = vitreo_uq_source_hash::of(places.iter().map(PathBuf::as_path))?;
    println!("cargo:rustc-env=VITREO_UQ_PROGRAM={hash:016x}");
    Ok(())
}
