//! A rigid sphere off the centre of the fixed outer sphere. The z axis is the line of the centres.
//!
//! There is no symmetry about z = 0. Both halves of the half meridian are therefore meshed. Cells
//! lie between circles of bipolar coordinates, the family to which both spheres belong, and the
//! circles that cross them at right angles. The mesh is the Möbius image of a concentric mesh: its
//! angles are right, and cells in the gap are small.

use std::f64::consts::FRAC_PI_2;

use super::element::ShapeTable;
use super::mesh::{Boundary, Mesh};
use super::solver::{Assembled, Motion};
use super::{Direction, Resolution};
use base::error::{Error, Result};

/// Largest ratio of the distances of successive mesh circles from the limiting point of their
/// bipolar family, on the side away from the gap.
const LAYER_RATIO: f64 = 2.0;
/// Number of equal angles from pole to pole in the concentric mesh, whose image is the eccentric
/// mesh.
const N_ANGLES: usize = 6;
/// Ratio of the distances of additional mesh rays from the gap's pole. In a small gap, the rays at
/// equal angles all lie close to this pole of the outer sphere. Additional rays fill the remaining
/// space.
const RAY_RATIO: f64 = 3.0;

/// A rigid sphere inside a fixed sphere. Lengths are in m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EccentricSphere {
    /// Radius of the rigid sphere.
    pub radius_m: f64,
    /// Radius of the fixed sphere.
    pub outer_radius_m: f64,
    /// Distance between the centres of the two spheres.
    pub offset_m: f64,
}

/// Stiffness of the gel for a rigid sphere off the centre, per Pa of Young's modulus. Forces and
/// torques are those on the whole sphere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EccentricStiffness {
    /// Force divided by displacement if the sphere does not rotate, in m.
    pub translation_m: f64,
    /// `translation_m` computed from the force on the outer sphere, in m.
    pub by_reaction_m: f64,
    /// Torque divided by rotation if the centre does not move, in m³. `None` for motion along the
    /// line of the centres.
    pub rotation_m3: Option<f64>,
    /// Torque divided by displacement, equal to force divided by rotation, in m². `None` for motion
    /// along the line of the centres.
    pub coupling_m2: Option<f64>,
    /// Force divided by displacement if the sphere is free to rotate, in m. In motion along the
    /// line of the centres the sphere does not rotate.
    pub free_translation_m: f64,
    /// Relative difference of `translation_m` from its value at the next lower order.
    pub relative_error: f64,
    /// Number of displacement unknowns, including those that are eliminated cell by cell.
    pub n_unknowns: usize,
}

impl EccentricSphere {
    /// Computes the stiffnesses for motion along the line of the centres ([`Direction::Axial`]) or
    /// across it. The Poisson ratio lies in (−1, ½). The number of rim layers has no effect.
    ///
    /// # Errors
    /// [`Error::Numerical`] if the gap is less than a millionth of the radius, or if the Poisson
    /// ratio or the order is out of range.
    pub fn solve(
        &self,
        poisson_ratio: f64,
        direction: Direction,
        resolution: Resolution,
    ) -> Result<EccentricStiffness> {
        let Self { radius_m, outer_radius_m, offset_m } = *self;
        let gap_m = outer_radius_m - offset_m - radius_m;
        if !(radius_m > 0.0 && offset_m >= 0.0 && outer_radius_m.is_finite() && gap_m > 1e-6 * radius_m) {
            return Err(Error::numerical(
                format!(
                    "no mesh fits between a sphere of radius {radius_m} m and one of {outer_radius_m} m, {offset_m} m off its centre"
                ),
                "give a sphere that lies inside the other with a gap",
            ));
        }
        let Resolution { order, formulation, .. } = resolution;
        if !(-1.0 < poisson_ratio && poisson_ratio < 0.5 && (4..=14).contains(&order)) {
            return Err(Error::numerical(
                format!("the Poisson ratio is {poisson_ratio} and the order {order}"),
                "give a Poisson ratio between −1 and 0.5, both excluded, and an order from 4 to 14",
            ));
        }
        let mesh = self.mesh();
        let (fine, coarse) = (ShapeTable::new(order), ShapeTable::new(order - 1));
        let assembled = Assembled::new(&mesh, &fine, direction, poisson_ratio, formulation)?;
        let translated = assembled.respond(Motion::Translation)?;
        let translation_m = assembled.energy(&translated, &translated);
        let (mut rotation_m3, mut coupling_m2, mut free_translation_m) = (None, None, translation_m);
        if direction == Direction::Transverse {
            let rotated = assembled.respond(Motion::Rotation { height_m: offset_m })?;
            let value = assembled.energy(&rotated, &rotated);
            let coupling = assembled.energy(&rotated, &translated);
            (rotation_m3, coupling_m2) = (Some(value), Some(coupling));
            free_translation_m -= coupling * coupling / value;
        }
        let less = Assembled::new(&mesh, &coarse, direction, poisson_ratio, formulation)?;
        let response = less.respond(Motion::Translation)?;
        Ok(EccentricStiffness {
            translation_m,
            by_reaction_m: assembled.reaction(&translated),
            rotation_m3,
            coupling_m2,
            free_translation_m,
            relative_error: (less.energy(&response, &response) / translation_m - 1.0).abs(),
            n_unknowns: assembled.n_unknowns(),
        })
    }

    /// Parameters of the Möbius map that takes the outer sphere to itself and a concentric sphere
    /// to the rigid sphere. The first is the image of the centre, the second the radius of the
    /// concentric sphere. Both are relative to the outer radius.
    fn concentric_parameters(&self) -> [f64; 2] {
        let [radius, offset] = [self.radius_m, self.offset_m].map(|x| x / self.outer_radius_m);
        // The image p of the centre is the inner limiting point of the family of circles. The
        // points p and p* are inverse in both spheres: p p* = 1, (d − p)(d − p*) = R².
        let half_sum = 0.5 * (1.0 + offset * offset - radius * radius);
        // half_sum − d, in a form without cancellation when the gap is small.
        let excess = 0.5 * ((1.0 - offset).powi(2) - radius * radius);
        let centre = offset / (half_sum + (excess * (half_sum + offset)).sqrt());
        // A concentric circle of radius s becomes a circle of radius s (1 − p²)/(1 − p² s²).
        let squeezed = 1.0 - centre * centre;
        let before = 2.0 * radius / (squeezed + (squeezed * squeezed + (2.0 * centre * radius).powi(2)).sqrt());
        [centre, before]
    }

    fn mesh(&self) -> Mesh {
        let [centre, before] = self.concentric_parameters();
        let squeezed = 1.0 - centre * centre;
        let first = before * squeezed / (1.0 - centre * before);
        let growth = (1.0 + centre) / first;
        let n_layers = (growth.ln() / LAYER_RATIO.ln()).ceil().max(1.0) as usize;
        let angles_rad = concentric_angles(centre);
        let last = angles_rad.len() - 1;
        let mut mesh = Mesh { is_whole: true, ..Mesh::default() };
        let mut inner = None;
        for layer in 0..=n_layers {
            let distance = first * growth.powf(layer as f64 / n_layers as f64);
            let s = distance / (squeezed + centre * distance);
            let below = 1.0 - (centre * s).powi(2);
            let (radius_m, height_m, surface) = match layer {
                0 => (self.radius_m, self.offset_m, Boundary { body: true, ..Boundary::INSIDE }),
                k if k == n_layers => (self.outer_radius_m, 0.0, Boundary { outer: true, ..Boundary::INSIDE }),
                _ => (
                    self.outer_radius_m * s * squeezed / below,
                    self.outer_radius_m * centre * (1.0 - s * s) / below,
                    Boundary::INSIDE,
                ),
            };
            // The points run from the upper to the lower pole. Between the poles they are the
            // crossings of the circle with the images of the rays.
            let angle = |k: usize| match k {
                0 => FRAC_PI_2,
                k if k == last => -FRAC_PI_2,
                _ => {
                    let (sin, cos) = angles_rad[k].sin_cos();
                    let along = 1.0 + 2.0 * centre * s * sin + (centre * s).powi(2);
                    let z = ((1.0 + 2.0 * centre * s * sin + s * s) * centre + squeezed * s * sin) / along;
                    let r = squeezed * s * cos / along;
                    (z - centre * (1.0 - s * s) / below).atan2(r)
                }
            };
            let angles: Vec<f64> = (0..=last).map(angle).collect();
            let chain = mesh.arcs([0.0, height_m], [radius_m; 2], &angles, surface);
            if let Some(inner) = inner.replace(chain.clone()) {
                mesh.rule(&inner, &chain);
            }
        }
        mesh
    }
}

/// Angles (rad) above the equator, in the concentric mesh, of the rays from the gap's pole to the
/// opposite pole.
fn concentric_angles(centre: f64) -> Vec<f64> {
    let mut angles: Vec<f64> = (0..N_ANGLES).map(|k| FRAC_PI_2 * (1.0 - 2.0 * k as f64 / N_ANGLES as f64)).collect();
    // On the outer sphere the map multiplies the tangent of half the angle from the pole by (1 −
    // p)/(1 + p), with p = `centre`.
    let stretch = (1.0 + centre) / (1.0 - centre);
    let mut tangent = (0.5 * (FRAC_PI_2 - angles[N_ANGLES - 1])).tan();
    while tangent < RAY_RATIO * stretch {
        tangent *= RAY_RATIO;
        angles.push(FRAC_PI_2 - 2.0 * tangent.atan());
    }
    angles.push(-FRAC_PI_2);
    angles
}
