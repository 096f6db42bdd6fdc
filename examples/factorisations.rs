//! What the direct solver takes on meshes around a sphere: unknowns, seconds of assembly with analysis, of factorisation and of a solve, and the most memory.
//!
//! `cargo run --release --example factorisations -- LEVEL`, one level a process, so that its memory is its own. Prints one line of JSON.

use std::time::Instant;

use vitreo_uq::error::{Error, Place, Result};
use vitreo_uq::fe::Stiffness;
use vitreo_uq::mesh::QuarterBall;

const POISSON_RATIO: f64 = 0.48;

fn main() -> Result<()> {
    let level = std::env::args().nth(1).and_then(|text| text.parse().ok()).filter(|level| (1..=40).contains(level));
    let level: usize =
        level.ok_or_else(|| Error::input(Place::default(), "no level", "give a level of the mesh, from 1 to 40"))?;
    let ball = QuarterBall { robot_radius_m: 0.275e-3, outer_radius_m: 10e-3, n_per_edge: level, n_layers: 4 * level };
    let began = Instant::now();
    let mesh = ball.mesh()?;
    let stiffness = Stiffness::new(&mesh)?;
    let analysed_s = began.elapsed().as_secs_f64();
    let began = Instant::now();
    let factor = stiffness.factor(POISSON_RATIO)?;
    let factorised_s = began.elapsed().as_secs_f64();
    let began = Instant::now();
    let response = factor.unit_response();
    let solved_s = began.elapsed().as_secs_f64();
    let line = serde_json::json!({
        "level": level,
        "unknowns": stiffness.n_unknowns(),
        "assembly_and_analysis_s": analysed_s,
        "factorisation_s": factorised_s,
        "solve_s": solved_s,
        "robot_m": response.last(),
        "peak_mib": peak_mib(),
    });
    println!("{line}");
    Ok(())
}

/// The most memory that this process has held, as Linux tells.
fn peak_mib() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM"))?;
    line.split_whitespace().nth(1)?.parse::<f64>().ok().map(|kib| kib / 1024.0)
}
