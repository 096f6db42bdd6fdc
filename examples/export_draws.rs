//! Writes one small posterior as CSV and as NetCDF-4 in ArviZ's layout: `cargo run --example export_draws -- DIR`.
//! `tests/python/open_netcdf.py DIR/draws.nc DIR/draws.csv` then opens both with ArviZ. `labelled.nc` holds the chains over named dimensions,
//! as for a hierarchy of groups; `tests/python/open_labelled_netcdf.py` opens it.

use std::path::PathBuf;

use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use vitreo_uq::figures::draws::{DrawTable, write_draws_csv};
use vitreo_uq::figures::labelled_netcdf::{Dimension, Variable, write_labelled_netcdf};
use vitreo_uq::figures::netcdf::{RecordGroups, RowColumn, write_draws_netcdf};

fn main() -> vitreo_uq::Result<()> {
    let dir = std::env::args_os().nth(1).map_or_else(std::env::temp_dir, PathBuf::from);
    let (n_ensembles, n_walkers, n_steps) = (4, 8, 500);
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
    let mut normal = || StandardNormal.sample(&mut rng);
    let (mut values, mut log_density) = (Vec::new(), Vec::new());
    for _ in 0..n_ensembles * n_walkers * n_steps {
        let (a, b, c): (f64, f64, f64) = (normal(), normal(), normal());
        values.extend([3.527 + 0.1 * a, 1.402 + 0.03 * (0.8 * a + 0.6 * b), 47.37 + 1.5 * c]);
        log_density.push(-0.5 * (a * a + b * b + c * c));
    }
    let table = DrawTable {
        parameter_names: ["young_modulus_pa", "viscosity_1_pa_s", "viscosity_2_pa_s"].map(String::from).to_vec(),
        units: ["Pa", "Pa·s", "Pa·s"].map(String::from).to_vec(),
        n_ensembles,
        n_walkers,
        n_steps,
        values,
        log_density,
    };
    let column = |name, unit, values: &[f64]| RowColumn { name, unit, values: values.to_vec() };
    let record = RecordGroups {
        constant: vec![column("time_s", "s", &[0.0, 0.05, 0.1])],
        observed_rows: vec![0, 1],
        observed: vec![column("position_um", "µm", &[0.0, 12.5])],
        ..RecordGroups::default()
    };
    write_draws_csv(&dir.join("draws.csv"), &table)?;
    write_draws_netcdf(&dir.join("draws.nc"), &table, &record)?;
    write_labelled(&dir, &table)?;
    let n_draws = table.n_draws();
    assert_eq!(n_draws, 16_000);
    println!("{n_draws} draws in {}", dir.display());
    Ok(())
}

/// Writes ensembles as groups: draws over (chain, draw, group, parameter), the first parameter also over (chain, draw, group), and the
/// log density of the first ensemble.
fn write_labelled(dir: &std::path::Path, table: &DrawTable) -> vitreo_uq::Result<()> {
    let (n_chains, n_draws, n_groups) = (table.n_walkers, table.n_steps, table.n_ensembles);
    let n_parameters = table.parameter_names.len();
    let mut values = Vec::new();
    for chain in 0..n_chains {
        for draw in 0..n_draws {
            for group in 0..n_groups {
                values.extend((0..n_parameters).map(|parameter| table.value(group, chain, draw, parameter)));
            }
        }
    }
    let young_modulus_pa = values.iter().copied().step_by(n_parameters).collect();
    let groups = ["porcine", "bovine, µ-rheology at 4 °C", "human", "gel / 1.5 %"];
    let dimensions = [
        Dimension { name: "group", labels: groups.map(String::from).to_vec() },
        Dimension { name: "parameter", labels: table.parameter_names.clone() },
    ];
    let variables = [
        Variable { name: "typical", unit: "", dimensions: vec!["group", "parameter"], values },
        Variable { name: "young_modulus_pa", unit: "Pa", dimensions: vec!["group"], values: young_modulus_pa },
        Variable {
            name: "lp",
            unit: "–",
            dimensions: vec![],
            values: table.log_density[..n_chains * n_draws].to_vec(),
        },
    ];
    write_labelled_netcdf(&dir.join("labelled.nc"), n_chains, n_draws, &dimensions, &variables)
}
