//! Measures the direct solver on meshes around a sphere: unknowns, seconds of assembly with analysis, of factorisation and of a solve,
//! the robot's displacement (m) at unit modulus and force, and the peak memory.
//!
//! `cargo run --release --example factorisations -- LEVEL` handles one level, so the memory belongs to that level alone. It prints one line of JSON.

use std::time::Instant;

use vitreo_uq::base::error::Result;
use vitreo_uq::elements::fe::Stiffness;

#[path = "shared/solver_mesh.rs"]
mod solver_mesh;

use solver_mesh::{POISSON_RATIO, asked_for, peak_mib};

fn main() -> Result<()> {
    let (level, ball) = asked_for()?;
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
