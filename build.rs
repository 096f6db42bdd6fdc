//! The hashes of sources: of those that reduced models are computed by, so that what one build of the program has kept for later serves another one as long as
//! the mechanics are the same; and of all, so that results that several machines made for one list are known to be of one program.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::Path;

/// What a reduced model depends on beside its input: meshes, finite elements, reduction, laws and effects. Statistics, figures, words and tests do not count.
const MECHANICS: [&str; 7] = ["effects", "fe", "mesh", "number", "rheology", "stages", "surrogate"];
/// What any result may depend on: all sources, embedded data, and the versions of other crates.
const PROGRAM: [&str; 7] = [
    "src",
    "crates/mechanics/src",
    "crates/inference/src",
    "crates/figures/src",
    "priors",
    "data/porcine-replica",
    "Cargo.lock",
];

fn main() -> std::io::Result<()> {
    let mechanics = MECHANICS.map(|place| Path::new("crates/mechanics/src").join(place));
    println!("cargo:rustc-env=VITREO_UQ_MECHANICS={:016x}", hash(mechanics.iter().map(|place| place.as_path()))?);
    println!("cargo:rustc-env=VITREO_UQ_PROGRAM={:016x}", hash(PROGRAM.iter().map(Path::new))?);
    Ok(())
}

fn hash<'a>(places: impl Iterator<Item = &'a Path>) -> std::io::Result<u64> {
    let mut hash = DefaultHasher::new();
    for place in places {
        println!("cargo:rerun-if-changed={}", place.display());
        add(place, &mut hash)?;
    }
    Ok(hash.finish())
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
