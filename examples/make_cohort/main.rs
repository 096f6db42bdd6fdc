//! Makes `data/cohort/` except its README: `cargo run --release --example make_cohort`.

mod cohort;

use std::path::Path;

use vitreo_uq::base::files::write_atomically;

fn main() -> vitreo_uq::Result<()> {
    let root = Path::new("data/cohort");
    let experiments = cohort::experiments();
    for species in &cohort::SPECIES {
        let stiffness = species.stiffness()?;
        let model = cohort::model(&stiffness)?;
        for experiment in experiments.iter().filter(|experiment| experiment.species.name == species.name) {
            let dir = root.join(&experiment.name);
            std::fs::create_dir_all(&dir).map_err(|source| {
                vitreo_uq::Error::at_path("create", &dir, source, "run it in the project's folder")
            })?;
            write_atomically(&dir.join("experiment.toml"), experiment.toml().as_bytes())?;
            write_atomically(&dir.join("trajectory.csv"), experiment.trajectory_csv(&model).as_bytes())?;
        }
    }
    write_atomically(&root.join("truth.csv"), cohort::truth_csv(&experiments).as_bytes())?;
    println!("wrote {} experiments to {}", experiments.len(), root.display());
    Ok(())
}
