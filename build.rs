//! The hash of the sources that reduced models are computed by, so that what one build of the program has kept for later serves another one as long as
//! the mechanics are the same.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::Path;

/// What a reduced model depends on beside its input: meshes, finite elements, reduction, laws and effects. Statistics, figures, words and tests do not count.
const MECHANICS: [&str; 7] = ["effects", "fe", "mesh", "number", "rheology", "stages", "surrogate"];

fn main() -> std::io::Result<()> {
    let mut hash = DefaultHasher::new();
    for place in MECHANICS {
        let place = Path::new("crates/mechanics/src").join(place);
        println!("cargo:rerun-if-changed={}", place.display());
        add(&place, &mut hash)?;
    }
    println!("cargo:rustc-env=VITREO_UQ_MECHANICS={:016x}", hash.finish());
    Ok(())
}

fn add(path: &Path, hash: &mut DefaultHasher) -> std::io::Result<()> {
    if path.file_name().is_some_and(|name| name == "tests.rs" || name.to_string_lossy().ends_with("_tests.rs")) {
        return Ok(());
    }
    if !path.is_dir() {
        std::fs::read(path)?.hash(hash);
        return Ok(());
    }
    let mut paths = std::fs::read_dir(path)?.map(|entry| entry.map(|e| e.path())).collect::<Result<Vec<_>, _>>()?;
    paths.sort();
    paths.iter().try_for_each(|path| add(path, hash))
}
