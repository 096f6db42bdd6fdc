//! A rigid sphere off the centre of the fixed outer sphere; z is the line of the centres.
//!
//! There is no symmetry about z = 0, so that the whole half meridian is meshed. Cells lie between the circles of bipolar coordinates, the family of both
//! spheres, and the circles across them. This is the Möbius image of a concentric mesh, with right angles and small cells in the gap.

use std::f64::consts::FRAC_PI_2;

use super::element::ShapeTable;
use super::mesh::{Boundary, Mesh};
use super::solver::{Assembled, Motion};
use super::{Direction, Resolution};
use base::error::{Error, Result};

/// Largest ratio of the distances of neighbouring circles from the limiting point, on the side away from the gap.
const LAYER_RATIO: f64 = 2.0;
/// Number of rays from pole to pole in the concentric image, at equal angles.
const N_ANGLES: usize = 6;
/// Ratio of the distances of further rays from the gap's pole. For a small gap the equal angles cluster at that pole of the outer sphere, so that further rays follow.
const RAY_RATIO: f64 = 3.0;

/// A rigid sphere in a fixed one, lengths in m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EccentricSphere {
    /// Radius of the rigid sphere.
    pub radius_m: f64,
    /// Radius of the fixed sphere.
    pub outer_radius_m: f64,
    /// Distance of the centres.
    pub offset_m: f64,
}

/// Stiffness of the whole body of an eccentric sphere, per Pa of Young's modulus.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EccentricStiffness {
    /// Force per displacement without rotation, in m.
    pub translation_m: f64,
    /// Force per displacement from the force on the outer sphere, in m.
    pub by_reaction_m: f64,
    /// Torque per rotation without displacement, in m³. Only for motion across the line of the centres.
    pub rotation_m3: Option<f64>,
    /// Torque per displacement, equal to force per rotation, in m². Only for motion across the line of the centres.
    pub coupling_m2: Option<f64>,
    /// Force per displacement of a sphere that is free to rotate, in m. Along the line of the centres it does not rotate.
    pub free_translation_m: f64,
    /// Relative difference of `translation_m` from that of the next lower order.
    pub relative_error: f64,
    /// Number of unknowns, including condensed ones, without pressures.
    pub n_unknowns: usize,
}

impl EccentricSphere {
    /// Solves for translations along the line of the centres ([`Direction::Axial`]) or across it, in a medium of this Poisson ratio in (−1, ½). Rim layers have no
    /// effect.
    ///
    /// # Errors
    /// [`Error::Numerical`] if the gap between the spheres is less than a millionth of the radius, or if ratio or order is out of range.
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

    /// Parameters of the Möbius map of the outer sphere to itself that maps concentric spheres to the family of both spheres.
    /// They are the image of the centre and the radius of the rigid sphere before mapping, both over the outer radius.
    fn concentric_picture(&self) -> [f64; 2] {
        let [radius, offset] = [self.radius_m, self.offset_m].map(|x| x / self.outer_radius_m);
        // The image of the centre is the family's limiting point p, the inner of two points that are inverse in both spheres: p p* = 1, (d − p)(d − p*) = R².
        let half_sum = 0.5 * (1.0 + offset * offset - radius * radius);
        // half_sum − d, without cancellation in the gap.
        let excess = 0.5 * ((1.0 - offset).powi(2) - radius * radius);
        let centre = offset / (half_sum + (excess * (half_sum + offset)).sqrt());
        // The image has the radius s (1 − p²)/(1 − p² s²).
        let squeezed = 1.0 - centre * centre;
        let before = 2.0 * radius / (squeezed + (squeezed * squeezed + (2.0 * centre * radius).powi(2)).sqrt());
        [centre, before]
    }

    fn mesh(&self) -> Mesh {
        let [centre, before] = self.concentric_picture();
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
            // From the upper pole to the lower one, at the crossings of the circle with the images of rays.
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

/// Angles of the rays above the equator in the concentric image, from the gap's pole to the other.
fn concentric_angles(centre: f64) -> Vec<f64> {
    let mut angles: Vec<f64> = (0..N_ANGLES).map(|k| FRAC_PI_2 * (1.0 - 2.0 * k as f64 / N_ANGLES as f64)).collect();
    // On the outer sphere the tangent of half the distance from the pole shrinks by (1 − p)/(1 + p).
    let stretch = (1.0 + centre) / (1.0 - centre);
    let mut tangent = (0.5 * (FRAC_PI_2 - angles[N_ANGLES - 1])).tan();
    while tangent < RAY_RATIO * stretch {
        tangent *= RAY_RATIO;
        angles.push(FRAC_PI_2 - 2.0 * tangent.atan());
    }
    angles.push(-FRAC_PI_2);
    angles
}
