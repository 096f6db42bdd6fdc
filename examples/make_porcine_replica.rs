//! Makes `data/porcine-replica/trajectory.csv`: `cargo run --release --example make_porcine_replica`.

fn main() -> vitreo_uq::Result<()> {
    let path = std::path::Path::new("data/porcine-replica/trajectory.csv");
    vitreo_uq::base::files::write_atomically(path, vitreo_uq::posterior::replica::trajectory_csv()?.as_bytes())?;
    println!("wrote {}", path.display());
    Ok(())
}
