//! The hash of the sources, so that what one build of the program has kept for later is not taken for another's.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::Path;

fn main() -> std::io::Result<()> {
    println!("cargo:rerun-if-changed=src");
    let mut hash = DefaultHasher::new();
    add(Path::new("src"), &mut hash)?;
    println!("cargo:rustc-env=VITREO_UQ_SOURCES={:016x}", hash.finish());
    Ok(())
}

fn add(folder: &Path, hash: &mut DefaultHasher) -> std::io::Result<()> {
    let mut paths = std::fs::read_dir(folder)?.map(|entry| entry.map(|e| e.path())).collect::<Result<Vec<_>, _>>()?;
    paths.sort();
    for path in paths {
        if path.is_dir() {
            add(&path, hash)?;
        } else {
            std::fs::read(&path)?.hash(hash);
        }
    }
    Ok(())
}
