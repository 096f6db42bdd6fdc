//! Prints diagnostics of draws as JSON. The input is a CSV with the columns `chain,draw,value`.
//!
//! `cargo run --example diagnose_draws -- draws.csv`

use std::collections::BTreeMap;
use vitreo_uq::base::error::InputPlace;
use vitreo_uq::sampling::diagnostics::{Chains, convergence, ess_bulk, ess_mean, ess_tail, mcse_mean, rhat};
use vitreo_uq::{Error, Result};

fn read(path: &str) -> Result<Chains> {
    let fail = |error: &dyn std::fmt::Display| {
        Error::input(InputPlace::file(path), error.to_string(), "give a CSV with the columns chain,draw,value")
    };
    let mut reader = csv::Reader::from_path(path).map_err(|error| fail(&error))?;
    let mut chains: BTreeMap<u64, BTreeMap<u64, f64>> = BTreeMap::new();
    for row in reader.deserialize::<(u64, u64, f64)>() {
        let (chain, draw, value) = row.map_err(|error| fail(&error))?;
        chains.entry(chain).or_default().insert(draw, value);
    }
    Ok(Chains::new(chains.into_values().map(|chain| chain.into_values().collect()).collect()))
}

fn main() -> Result<()> {
    for path in std::env::args().skip(1) {
        let draws = read(&path)?;
        let found = serde_json::json!({
            "rhat": rhat(&draws),
            "ess_bulk": ess_bulk(&draws),
            "ess_tail": ess_tail(&draws),
            "ess_mean": ess_mean(&draws),
            "mcse_mean": mcse_mean(&draws),
            "autocorrelation_time": convergence::autocorrelation_time(&draws),
        });
        println!("{found}");
    }
    Ok(())
}
