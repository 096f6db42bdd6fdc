//! Hashes the sources of the whole program, so that results which several machines made for one list are known to be of one program.

use std::path::Path;

/// All sources, embedded data, and the versions of other crates.
const PROGRAM: [&str; 5] = ["src", "crates", "priors", "data/porcine-replica", "Cargo.lock"];

fn main() -> std::io::Result<()> {
    let hash = vitreo_uq_source_hash::of(PROGRAM.map(Path::new))?;
    println!("cargo:rustc-env=VITREO_UQ_PROGRAM={hash:016x}");
    Ok(())
}
