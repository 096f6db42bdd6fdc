//! Meshes for measuring solvers, and the memory of a process.

use vitreo_uq::base::error::{Error, InputPlace, Result};
use vitreo_uq::elements::mesh::QuarterBall;

/// Poisson ratio of the gel.
pub const POISSON_RATIO: f64 = 0.48;

/// Returns the mesh level that the program's argument gives, and the mesh around a sphere at this level.
pub fn asked_for() -> Result<(usize, QuarterBall)> {
    let level = std::env::args().nth(1).and_then(|text| text.parse().ok()).filter(|level| (1..=40).contains(level));
    let level: usize = level
        .ok_or_else(|| Error::input(InputPlace::default(), "no level", "give a level of the mesh, from 1 to 40"))?;
    let ball = QuarterBall { robot_radius_m: 0.275e-3, outer_radius_m: 10e-3, n_per_edge: level, n_layers: 4 * level };
    Ok((level, ball))
}

/// Peak memory of this process in MiB, as reported by Linux.
pub fn peak_mib() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM"))?;
    line.split_whitespace().nth(1)?.parse::<f64>().ok().map(|kib| kib / 1024.0)
}
