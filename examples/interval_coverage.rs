//! Counts how often 90 % intervals of an effect's first parameter contain a truth drawn from the priors.
//!
//! `cargo run --release --example interval_coverage -- --count 240 --first 0 --seed 1 --json coverage.json [--effects a,b] [--least-sigma 5]`

use std::path::{Path, PathBuf};
use std::str::FromStr;

use vitreo_uq::base::error::{Error, InputPlace, Result};
use vitreo_uq::base::files::write_json_atomically;
use vitreo_uq::posterior::monitor::SilentMonitor;
use vitreo_uq::validation::challenge::Bench;
use vitreo_uq::validation::challenge::coverage::{CoverageRequest, count};

/// Effects with the most difficult posteriors: two modes, ridges, parameters that are unidentified at the null.
const EFFECTS: [&str; 4] = ["interface-slip", "poroelasticity", "liquefied-pocket", "second-retardation"];

fn parsed<T: FromStr>(option: &'static str, text: &str) -> Result<T> {
    text.parse().map_err(|_| {
        Error::input(InputPlace::default().at_key(option), format!("`{text}` is not a number"), "give a number")
    })
}

fn main() -> Result<()> {
    let effects = EFFECTS.map(String::from).to_vec();
    let mut request = CoverageRequest { count: 8, first: 0, effects, least_sigma: 5.0, seed: 1 };
    let mut json: Option<PathBuf> = None;
    let mut arguments = std::env::args().skip(1);
    while let Some(option) = arguments.next() {
        let value = arguments.next().unwrap_or_default();
        match option.as_str() {
            "--count" => request.count = parsed("--count", &value)?,
            "--first" => request.first = parsed("--first", &value)?,
            "--seed" => request.seed = parsed("--seed", &value)?,
            "--least-sigma" => request.least_sigma = parsed("--least-sigma", &value)?,
            "--effects" => request.effects = value.split(',').map(String::from).collect(),
            "--json" => json = Some(Path::new(&value).into()),
            _ => {
                let found = format!("`{option}` is not an option of this program");
                let remedy = "give --count, --first, --seed, --least-sigma, --effects or --json";
                return Err(Error::input(InputPlace::default().at_key("interval_coverage"), found, remedy));
            }
        }
    }
    let bench = Bench::new(&SilentMonitor)?;
    let coverage = count(&bench, &request, &SilentMonitor)?;
    for effect in &coverage.effects {
        println!(
            "{:<24}{:>4} of {:>4} covered, {} with several answers, {} failed",
            effect.effect, effect.covered, effect.counted, effect.with_several_answers, effect.failed
        );
    }
    println!("{:<24}{:.3} of {}", "all", coverage.share, coverage.counted);
    if let Some(path) = json {
        write_json_atomically(&path, &coverage)?;
    }
    Ok(())
}
