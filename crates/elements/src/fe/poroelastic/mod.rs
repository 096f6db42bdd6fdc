//! Pore flow around the robot: Biot's quasi-static equations with displacements and pressures
//! (physics §5, `poroelasticity`; exact references §4.2, §4.9).
//!
//! The law acts on the skeleton and on the storage alike. Let p = G p', with the pressure p and the
//! law's modulus G(s) at the Laplace variable s. The whole body is then one operator in the
//! drainage area τ = k G/s (m²), with the mobility k in m²/(Pa·s):
//!
//!  K_d u − Bᵀp' = f/G,  B u + (M/M̂ + τH) p' = 0.
//!
//! u are the displacements and f the load. B, M and H are the divergence, mass and diffusion
//! matrices of [`PressureSpace`]. K_d = 2μ̂ K_dev + κ̂_d K_vol is the stiffness of the drained
//! skeleton, with the deviatoric and volumetric parts of [`crate::fe::Assembly`]. The shear modulus
//! μ̂ is equal for the drained and the undrained body. The bulk modulus is κ̂ = 2μ̂(1 + ν)/(3(1 −
//! 2ν)) at the drained (κ̂_d) or undrained (κ̂_u) Poisson ratio ν. The storage is 1/M̂ = 1/(κ̂_u −
//! κ̂_d) (M. A. Biot 1941, doi:10.1063/1.1712886, with α = 1).
//!
//! The robot's compliance is Φ(τ)/G, with Φ(τ) = eᵀ[K_d + Bᵀ(M/M̂ + τH)⁻¹B]⁻¹e and e the unit
//! force. It rises from the undrained Φ(0) to the drained Φ(∞): Φ(τ) = Φ(0) (1 + Σ wₖ τ/(τ + τₖ))
//! with weights wₖ > 0 and areas τₖ > 0. [`PoreSpectrum`] gives at most ten such terms for any
//! drained Poisson ratio.
//!
//! The elements are of Taylor–Hood type: the project's displacements with continuous pressures that
//! are linear between the corners. This combination is stable. K_d is proportional to the base
//! model's stiffness at the drained Poisson ratio. The drained limit therefore equals the base
//! model to rounding. The undrained limit differs from the base model by 1e-5 on the model mesh,
//! because its discretisation is another. Between the limits the linear pressures have an error of
//! second order, up to 4e-4 of the compliance on a mesh like the model's.

mod condensed;
mod creep;
mod drained;
mod pressure;
mod spectrum;
mod terms;

pub use condensed::CondensedPores;
pub use drained::DrainedModel;
pub use pressure::PressureSpace;
pub use spectrum::{PoreSpectrum, PoreTerm, SpectrumSettings};

use crate::fe::Stiffness;
use crate::mesh::Mesh;
use base::error::{Error, Result};

/// A mesh with pore pressures, at one undrained Poisson ratio.
pub struct PoreModel<'a> {
    stiffness: &'a Stiffness,
    pressures: PressureSpace,
    poisson_ratio: f64,
    /// Shortest and longest length (m) over which pressures vary: the robot's smallest radius and
    /// the mesh's largest radius.
    lengths_m: [f64; 2],
}

impl<'a> PoreModel<'a> {
    /// Adds pressures to a mesh and its stiffness. `poisson_ratio` is the undrained Poisson ratio,
    /// below ½.
    ///
    /// # Errors
    /// Those of [`PressureSpace::new`], and [`Error::Numerical`] if the Poisson ratio lies outside
    /// (−1, ½).
    pub fn new(mesh: &Mesh, stiffness: &'a Stiffness, poisson_ratio: f64) -> Result<Self> {
        if !(poisson_ratio > -1.0 && poisson_ratio < 0.5) {
            return Err(Error::numerical(
                format!("the undrained Poisson ratio is {poisson_ratio}"),
                "give a Poisson ratio in (−1, ½); water-filled gels have one just below ½",
            ));
        }
        let pressures = PressureSpace::new(mesh, &stiffness.assembly.unknowns)?;
        let radius = |node: u32| mesh.node_coordinates_m[node as usize].iter().map(|x| x * x).sum::<f64>().sqrt();
        let smallest = mesh.robot_nodes.iter().map(|&node| radius(node)).fold(f64::INFINITY, f64::min);
        let largest = mesh.outer_nodes.iter().map(|&node| radius(node)).fold(0.0, f64::max);
        Ok(Self { stiffness, pressures, poisson_ratio, lengths_m: [smallest, largest] })
    }

    /// Pressure unknowns and their matrices.
    pub fn pressures(&self) -> &PressureSpace {
        &self.pressures
    }

    /// Undrained Poisson ratio.
    pub fn poisson_ratio(&self) -> f64 {
        self.poisson_ratio
    }

    /// Returns the model at a drained Poisson ratio in (−1, ν), with ν the undrained ratio.
    ///
    /// # Errors
    /// [`Error::Numerical`] for a ratio outside this range.
    pub fn drained(&'a self, drained_poisson_ratio: f64) -> Result<DrainedModel<'a>> {
        if !(drained_poisson_ratio > -1.0 && drained_poisson_ratio < self.poisson_ratio) {
            return Err(Error::numerical(
                format!(
                    "the drained Poisson ratio is {drained_poisson_ratio} and the undrained one {}",
                    self.poisson_ratio
                ),
                "give a drained Poisson ratio above −1 and below the undrained one: drainage softens the gel",
            ));
        }
        DrainedModel::new(self, drained_poisson_ratio)
    }
}
