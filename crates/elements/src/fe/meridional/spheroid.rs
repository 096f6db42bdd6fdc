//! Mesh of the gel around a spheroid. Nearly confocal ellipses lead from the body to the outer
//! sphere.

use std::f64::consts::FRAC_PI_2;

use super::mesh::{Boundary, Mesh, graded};

/// Ratio of the minor semi-axes of successive ellipses.
const LAYER_RATIO: f64 = 2.0;
/// Eccentric angle between the tip and the first ray, divided by the angle ξ of the field's poles
/// ([`mesh`]).
const FIRST_ANGLE: f64 = 1.5;
/// Ratio of the eccentric angles of successive rays, counted from the tip.
const ANGLE_RATIO: f64 = 3.0;

/// Meshes the gel around a spheroid with semi-axes `along_m` and `across_m` (m), inside a sphere of
/// `outer_radius_m` (m).
///
/// Let m and M be the minor and major semi-axes. In a confocal family M² − m² is constant. Here M²
/// is instead a linear function of m² that makes both equal the outer radius at the sphere. The
/// fields have poles at the foci, which lie at ±iξ in the eccentric angle from the tip, with tanh
/// ξ = m/M on the body. Rays are graded towards the tip, so that every element is small relative to
/// its distance from the poles.
pub(super) fn mesh(along_m: f64, across_m: f64, outer_radius_m: f64) -> Mesh {
    let (minor, major) = (along_m.min(across_m), along_m.max(across_m));
    let (m2, major2, outer2) = (minor * minor, major * major, outer_radius_m * outer_radius_m);
    let from_tip = graded(FIRST_ANGLE * (minor / major).atanh(), ANGLE_RATIO, FRAC_PI_2);
    // The tip is on the axis or, for a disc, on the equator. Chains start at the axis.
    let angles: Vec<f64> = if along_m >= across_m {
        from_tip.iter().map(|t| FRAC_PI_2 - t).collect()
    } else {
        from_tip.into_iter().rev().collect()
    };
    let mut mesh = Mesh::default();
    let n_layers = ((outer_radius_m / minor).ln() / LAYER_RATIO.ln()).ceil().max(1.0) as usize;
    let mut inner = None;
    for layer in 0..=n_layers {
        let mk = minor * (outer_radius_m / minor).powf(layer as f64 / n_layers as f64);
        let confocal = (major2 + (outer2 - major2) * (mk * mk - m2) / (outer2 - m2)).sqrt();
        let (mk, confocal, surface) = match layer {
            0 => (minor, major, Boundary { body: true, ..Boundary::INSIDE }),
            k if k == n_layers => (outer_radius_m, outer_radius_m, Boundary { outer: true, ..Boundary::INSIDE }),
            _ => (mk, confocal, Boundary::INSIDE),
        };
        let semi_axes = if along_m >= across_m { [mk, confocal] } else { [confocal, mk] };
        let chain = mesh.arcs([0.0; 2], semi_axes, &angles, surface);
        if let Some(inner) = inner.replace(chain.clone()) {
            mesh.rule(&inner, &chain);
        }
    }
    mesh
}
