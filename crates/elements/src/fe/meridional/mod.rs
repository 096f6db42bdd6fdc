//! Rigid bodies of revolution in a fixed sphere, solved in the half meridian: nonlinear laws around
//! a sphere, and reference solutions for the three-dimensional elements.
//!
//! The quasi-static balance of an isotropic medium (physics §3.1) separates in the angle θ around
//! the body's axis z. The displacement of mode n is u_r = U cos nθ, u_θ = V sin nθ, u_z = W cos nθ.
//! A translation of the body along the axis excites mode n = 0, with V = 0. A translation across
//! the axis excites mode n = 1. Its direction is x = cos θ e_r − sin θ e_θ, so that U = −V = 1 on
//! the body. Only the coordinates r and z remain. By symmetry only z ≥ 0 is meshed.
//!
//! Elements are quadrilaterals of high order on exact geometry, with discontinuous pressures one
//! degree lower. The pressures are eliminated element by element. Around a smooth body the error
//! falls more than tenfold per order, for any Poisson ratio below ½. At the sharp rim of a cylinder
//! the field varies like ρ^0.55 with the distance ρ. Cells shrink towards the rim in geometric
//! progression, so that the error still falls exponentially (hp version; C. Schwab, *p- and
//! hp-Finite Element Methods*, 1998).
//!
//! The module shares only the dense and sparse Cholesky kernels of `faer` with the
//! three-dimensional elements.

pub(super) mod basis;
mod cylinder;
mod eccentric;
mod elastic;
mod element;
pub(super) mod geometry;
pub(super) mod mesh;
mod nonlinear;
mod pair;
#[cfg(test)]
mod patch_tests;
pub(super) mod solver;
mod spheroid;

use std::f64::consts::PI;

use base::error::{Error, Result};
pub use eccentric::{EccentricSphere, EccentricStiffness};
pub use elastic::{ElasticRobot, solve_elastic};
use element::ShapeTable;
use mesh::Mesh;
pub use nonlinear::NonlinearBall;
pub use pair::{EffectMatrix, build_effect_system};

/// A rigid body of revolution about the z axis, symmetric about the plane z = 0. Lengths are in m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum BodyOfRevolution {
    /// Prolate or oblate spheroid, or sphere.
    Spheroid {
        /// Half the length along the axis of revolution.
        semi_axis_along_m: f64,
        /// Half the diameter across the axis of revolution.
        semi_axis_across_m: f64,
    },
    /// Right circular cylinder with sharp rims.
    Cylinder {
        /// Length along the axis of revolution.
        length_m: f64,
        /// Diameter across the axis of revolution.
        diameter_m: f64,
    },
}

impl BodyOfRevolution {
    /// A sphere of radius `radius_m` (m).
    pub fn sphere(radius_m: f64) -> Self {
        Self::Spheroid { semi_axis_along_m: radius_m, semi_axis_across_m: radius_m }
    }

    /// Volume of the body in m³.
    pub fn volume_m3(&self) -> f64 {
        match *self {
            Self::Spheroid { semi_axis_along_m: a, semi_axis_across_m: b } => 4.0 / 3.0 * PI * a * b * b,
            Self::Cylinder { length_m, diameter_m } => PI / 4.0 * diameter_m * diameter_m * length_m,
        }
    }

    /// Area of the body's surface in m².
    pub fn surface_area_m2(&self) -> f64 {
        match *self {
            Self::Spheroid { semi_axis_along_m: a, semi_axis_across_m: b } => {
                let e = (1.0 - (a.min(b) / a.max(b)).powi(2)).sqrt();
                let second = match () {
                    // Limits for e → 0: asin e / e and (1 − e²) atanh e / e tend to 1.
                    () if e < 1e-4 => a * b,
                    () if a > b => a * b * e.asin() / e,
                    () => a * a * e.atanh() / e,
                };
                2.0 * PI * (b * b + second)
            }
            Self::Cylinder { length_m, diameter_m } => PI * diameter_m * (0.5 * diameter_m + length_m),
        }
    }

    /// Returns a body of this shape with `factor` times its lengths.
    pub fn scaled(&self, factor: f64) -> Self {
        match *self {
            Self::Spheroid { semi_axis_along_m, semi_axis_across_m } => Self::Spheroid {
                semi_axis_along_m: factor * semi_axis_along_m,
                semi_axis_across_m: factor * semi_axis_across_m,
            },
            Self::Cylinder { length_m, diameter_m } => {
                Self::Cylinder { length_m: factor * length_m, diameter_m: factor * diameter_m }
            }
        }
    }

    /// Three lengths (m): half the extent across the axis, half the extent along it, and the radius
    /// of the smallest sphere around the body.
    pub(in crate::fe) fn extents_m(&self) -> [f64; 3] {
        match *self {
            Self::Spheroid { semi_axis_along_m: a, semi_axis_across_m: b } => [b, a, a.max(b)],
            Self::Cylinder { length_m, diameter_m } => {
                [0.5 * diameter_m, 0.5 * length_m, 0.5 * diameter_m.hypot(length_m)]
            }
        }
    }

    pub(in crate::fe) fn mesh(&self, outer_radius_m: f64, rim_layers: usize) -> Mesh {
        let [across_m, along_m, _] = self.extents_m();
        match self {
            Self::Spheroid { .. } => spheroid::mesh(along_m, across_m, outer_radius_m),
            Self::Cylinder { .. } => cylinder::mesh(across_m, along_m, outer_radius_m, rim_layers),
        }
    }
}

/// Direction of the body's translation and of the force on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// Along the axis of revolution: the force is parallel to a long body.
    Axial,
    /// Across the axis of revolution: the force is perpendicular to a long body.
    Transverse,
}

/// Formulation of the gel's volumetric strain energy.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Formulation {
    /// The volumetric strain is projected on discontinuous pressures, which are polynomials of
    /// total degree order − 1. This formulation does not lock.
    Mixed,
    /// The unknowns are displacements alone. This formulation checks [`Self::Mixed`]. Its stiffness
    /// approaches the exact value from above. Near a Poisson ratio of ½ it needs one or two
    /// polynomial orders more.
    Displacement,
}

/// Refinement of the meridional discretisation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Resolution {
    /// Polynomial order of the displacements, 3 to 14.
    pub order: usize,
    /// Number of layers of cells around the rim of a cylinder, 1 to 12. Each layer is 0.15 times as
    /// far from the rim as the previous one. The value has no effect on spheroids.
    pub rim_layers: usize,
    /// Formulation of the volumetric strain energy.
    pub formulation: Formulation,
}

impl Default for Resolution {
    /// Settings with relative errors below 10⁻⁸ for aspect ratios from 0.1 to 20. The outer
    /// sphere's radius must be at least 1.5 times that of the body's circumscribed sphere.
    fn default() -> Self {
        Self { order: 10, rim_layers: 9, formulation: Formulation::Mixed }
    }
}

/// Stiffness of the gel around the body: force on the whole body divided by its displacement and by
/// Young's modulus, in m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeridionalSolution {
    /// Stiffness from the strain energy: twice the energy of unit displacement.
    pub stiffness_m: f64,
    /// Stiffness from the force on the outer sphere. It differs from `stiffness_m` only by
    /// rounding.
    pub reaction_stiffness_m: f64,
    /// Relative difference from a solution with one order and one rim layer less. It estimates the
    /// error of that coarser solution and is therefore conservative. It is at least the relative
    /// difference of `stiffness_m` and `reaction_stiffness_m`.
    pub relative_error: f64,
    /// Number of displacement unknowns, including those that are eliminated cell by cell.
    pub n_unknowns: usize,
}

/// Smallest half extent of a body relative to the outer radius. For smaller bodies the meshes would
/// be needlessly large.
const SMALLEST_EXTENT: f64 = 1e-6;

/// Solves for the stiffness of `body` at the centre of a fixed sphere of `outer_radius_m` (m). The
/// gel's Poisson ratio must lie in (−1, ½).
///
/// Fails with [`Error::Numerical`] if the body does not lie inside the sphere or is thinner than a
/// millionth of it. Also fails if the Poisson ratio or the resolution is out of range.
pub fn solve(
    body: BodyOfRevolution,
    outer_radius_m: f64,
    poisson_ratio: f64,
    direction: Direction,
    resolution: Resolution,
) -> Result<MeridionalSolution> {
    let fits = |x: f64| x >= SMALLEST_EXTENT * outer_radius_m && x < outer_radius_m;
    if !(outer_radius_m > 0.0 && outer_radius_m.is_finite() && body.extents_m().into_iter().all(fits)) {
        return Err(Error::numerical(
            format!("no mesh fits between {body:?} and a sphere of radius {outer_radius_m} m"),
            "give a body that lies inside the vitreous and is no thinner than a millionth of it",
        ));
    }
    if !(-1.0 < poisson_ratio && poisson_ratio < 0.5) {
        return Err(Error::numerical(
            format!("the Poisson ratio is {poisson_ratio}"),
            "give a Poisson ratio between −1 and 0.5, both excluded",
        ));
    }
    let Resolution { order, rim_layers, formulation } = resolution;
    if !((3..=14).contains(&order) && (1..=12).contains(&rim_layers)) {
        return Err(Error::numerical(
            format!("the order is {order}, with {rim_layers} layers around the rim"),
            "give an order from 3 to 14 and from 1 to 12 layers",
        ));
    }
    let discrete = |order: usize, rim_layers: usize| {
        let mesh = body.mesh(outer_radius_m, rim_layers);
        solver::solve(&mesh, &ShapeTable::new(order), direction, poisson_ratio, formulation)
    };
    let (fine, coarse) = (discrete(order, rim_layers)?, discrete(order - 1, rim_layers - 1)?);
    let difference = |other: f64| (other / fine.by_energy_m - 1.0).abs();
    Ok(MeridionalSolution {
        stiffness_m: fine.by_energy_m,
        reaction_stiffness_m: fine.by_reaction_m,
        relative_error: difference(coarse.by_energy_m).max(difference(fine.by_reaction_m)),
        n_unknowns: fine.n_unknowns,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks the paper's surface areas at equal volume (physics §4.4). Also checks that a
    /// spheroid's area is continuous where it becomes a sphere.
    #[test]
    fn sizes_are_the_papers() {
        let sphere = BodyOfRevolution::sphere(0.275e-3);
        let aspect = 68.0 / 7.0;
        let bodies = [
            BodyOfRevolution::Spheroid { semi_axis_along_m: aspect, semi_axis_across_m: 1.0 },
            BodyOfRevolution::Cylinder { length_m: aspect, diameter_m: 1.0 },
        ];
        for (body, area) in bodies.into_iter().zip([1.684, 1.712]) {
            let body = body.scaled((sphere.volume_m3() / body.volume_m3()).cbrt());
            assert!((body.volume_m3() / sphere.volume_m3() - 1.0).abs() < 1e-14);
            let ratio = body.surface_area_m2() / sphere.surface_area_m2();
            assert!((ratio - area).abs() < 1e-3, "{ratio}");
        }
        for along in [0.999, 1.001] {
            let area = |along| {
                BodyOfRevolution::Spheroid { semi_axis_along_m: along, semi_axis_across_m: 1.0 }.surface_area_m2()
            };
            // The area of a sphere that is stretched along its axis grows by two thirds of the
            // stretch, to first order.
            assert!((area(along) / (4.0 * PI) - 1.0 - (along - 1.0) * 2.0 / 3.0).abs() < 1e-6);
        }
    }

    /// Checks that the cells fill the space between body and sphere exactly once.
    #[test]
    fn cells_have_the_volume_of_the_gel() {
        let outer_radius_m = 3.0;
        for along in [0.1_f64, 0.9, 1.0, 1.3, 2.5] {
            for body in [
                BodyOfRevolution::Spheroid { semi_axis_along_m: along, semi_axis_across_m: 1.0 },
                BodyOfRevolution::Cylinder { length_m: 2.0 * along, diameter_m: 2.0 },
            ] {
                let mesh = body.mesh(outer_radius_m, 5);
                let line = basis::gauss_legendre(14);
                let mut volume_m3 = 0.0;
                for cell in &mesh.cells {
                    for &(xi, w_xi) in &line {
                        for &(eta, w_eta) in &line {
                            let (at, along, across) = cell.map.at(xi, eta);
                            let jacobian = along[0] * across[1] - along[1] * across[0];
                            assert!(jacobian > 0.0 && at[0] > 0.0, "{body:?}");
                            volume_m3 += 4.0 * PI * w_xi * w_eta * jacobian * at[0];
                        }
                    }
                }
                let gel_m3 = BodyOfRevolution::sphere(outer_radius_m).volume_m3() - body.volume_m3();
                assert!((volume_m3 / gel_m3 - 1.0).abs() < 1e-12, "{body:?}: {volume_m3} against {gel_m3}");
            }
        }
    }
}
