//! Corner plot of one or more CSV files of draws: `cargo run --example corner_plot -- OUT_DIR DRAWS.csv…`.

use std::path::PathBuf;

use vitreo_uq::figures::corner::{CornerOptions, ParameterColumn, Posterior, corner};
use vitreo_uq::figures::density::{estimate_support, sorted};
use vitreo_uq::figures::draws::{DrawTable, read_draws_csv};
use vitreo_uq::figures::labels::{ParameterLabel, parameter_label};
use vitreo_uq::figures::palette::series;
use vitreo_uq::figures::svg::write_figure;

struct Loaded {
    label: String,
    table: DrawTable,
    columns: Vec<(ParameterLabel, Vec<f64>)>,
}

fn load(path: PathBuf) -> vitreo_uq::Result<Loaded> {
    let table = read_draws_csv(&path)?;
    let columns =
        table.parameter_names.iter().enumerate().map(|(i, name)| (parameter_label(name), table.column(i))).collect();
    let label = path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
    Ok(Loaded { label, table, columns })
}

fn main() -> vitreo_uq::Result<()> {
    let mut arguments = std::env::args_os().skip(1).map(PathBuf::from);
    let dir = arguments.next().unwrap_or_else(std::env::temp_dir);
    let loaded = arguments.map(load).collect::<vitreo_uq::Result<Vec<_>>>()?;
    let posteriors: Vec<Posterior> = loaded
        .iter()
        .enumerate()
        .map(|(i, posterior)| Posterior {
            label: &posterior.label,
            colour: series(i),
            parameters: parameters(posterior),
        })
        .collect();
    let figure = corner(&posteriors, &CornerOptions::default())?;
    write_figure(&dir, "corner", &figure)?;
    println!("corner.svg and corner.png in {}", dir.display());
    Ok(())
}

fn parameters(posterior: &Loaded) -> Vec<ParameterColumn<'_>> {
    let names = posterior.table.parameter_names.iter();
    names
        .zip(&posterior.columns)
        .map(|(name, (label, draws))| ParameterColumn {
            name,
            symbol: &label.symbol,
            unit: &label.unit,
            draws,
            support: estimate_support(&sorted(draws)),
            prior: None,
            reference: None,
        })
        .collect()
}
