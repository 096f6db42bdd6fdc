//! Build script that hashes the sources on which reduced models depend. Builds with equal sources share their cached models.

use std::path::Path;

/// Crates on whose code a reduced model may depend.
const MECHANICS: [&str; 5] = ["base", "record", "laws", "elements", "models"];

fn main() -> std::io::Result<()> {
    let sources = MECHANICS.map(|name| Path::new("..").join(name).join("src"));
    let hash = vitreo_uq_source_hash::of(sources.iter().map(|path| path.as_path()))?;
    println!("cargo:rustc-env=VITREO_UQ_MECHANICS={hash:016x}");
    Ok(())
}
