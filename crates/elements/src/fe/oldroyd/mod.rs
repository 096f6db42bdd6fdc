//! Large displacements of a body of revolution that is pulled along its axis. The gel is the fluid
//! whose small-strain limit is the given law (physics §7.6).
//!
//! **Law.** In the incompressible limit, the Lethersich law is the small-strain limit of the
//! Oldroyd-B fluid (J. G. Oldroyd, Proc. R. Soc. Lond. A 200:523, 1950,
//! doi:10.1098/rspa.1950.0035). Any series of Kelvin–Voigt bodies, springs and dashpots is the
//! limit of an Oldroyd-B fluid with several modes. F is the deformation gradient and C = FᵀF. The
//! conformation A = F S Fᵀ of a mode measures the stretch of its polymer. In coordinates of the
//! undeformed gel, it obeys Ṡ = −(S − C⁻¹)/λ at every point independently, without convection. λ is
//! the mode's relaxation time. The stress is −p + 2η_s D + Σ G A, with the pressure p, the
//! solvent's viscosity η_s, the strain rate D and the modes' moduli G. A mobility α gives
//! Giesekus's fluid (H. Giesekus, J. Non-Newton. Fluid Mech. 11:69, 1982,
//! doi:10.1016/0377-0257(82)85016-7), which has an equal small-strain limit.
//!
//! **Space.** The mesh covers both halves of the undeformed half meridian (total Lagrangian
//! formulation). It is bonded to the body and to the wall and moves with the gel. Displacements are
//! polynomials of high order. Discontinuous pressures are one degree lower, as in
//! [`crate::fe::meridional`], and enforce det F = 1 in the mean. The unknowns inside the cells are
//! eliminated cell by cell.
//!
//! **Time.** The time stepper is the fourth-order method of [`crate::fe::clock`], whose stages are
//! steps of implicit Euler. A stage's conformation follows from its displacement, so that only
//! displacement and pressure are unknown. Newton's method keeps one matrix as long as it converges.
//!
//! **Deviation.** A twin, which is an equal gel with small strains, takes equal steps. The reported
//! deviation is the difference from the twin, in which common errors of mesh and steps cancel. The
//! final position is the linear model's response at its own Poisson ratio plus this deviation.
//!
//! **Limits.** The gel is bonded: it neither tears nor slides. It is incompressible unless
//! [`VolumeRule`] says otherwise. The Poisson ratio determines the gel's volume only at small
//! strains, so that studies must choose a rule. Cells in front of the body are pressed flat. The
//! run ends with an error if, at some point, a volume that should stay constant becomes a tenth or
//! ten times as large.

mod cell;
#[cfg(test)]
mod eulerian;
mod field;
#[cfg(test)]
mod independent_tests;
mod law;
mod lu;
mod point;
mod run;
#[cfg(test)]
mod tests;

pub use law::{FiniteLaw, RelaxationMode};

use std::f64::consts::FRAC_PI_2;

use super::meridional::BodyOfRevolution;
use super::meridional::basis::lagrange;
use super::meridional::mesh::{Boundary, Mesh};
use base::error::{Error, Result};
use field::{BODY, FieldMesh, FieldStage, Solver, VolumeResistance};
use laws::stages::{Load, Spatial};
use point::{AT_REST, StageLaw};
use record::Force;
use run::{AppliedForce, Moment, run_pull};

/// Refinement of mesh and time steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Discretisation {
    /// Polynomial order of the displacements, 3 to 10.
    pub order: usize,
    /// Number of cells from pole to pole around a sphere. Meshes around spheroids and cylinders
    /// choose their own number.
    pub n_angles: usize,
    /// Mean ratio of successive layers' radii. Layers are thinner near the body and thicker far
    /// from it.
    pub layer_ratio: f64,
    /// Number of steps during which the time since a switch doubles.
    pub steps_per_doubling: u32,
}

impl Discretisation {
    /// Settings for a quick estimate: an error of 0.3 µm over the paper's four cycles, four times
    /// as fast as the default.
    pub const ESTIMATE: Self = Self { order: 5, n_angles: 4, layer_ratio: 2.0, steps_per_doubling: 3 };
}

impl Default for Discretisation {
    /// Settings with an error of 0.1 µm over the paper's four cycles, in which the body moves by
    /// 3.6 radii.
    fn default() -> Self {
        Self { order: 5, n_angles: 6, layer_ratio: 2.0, steps_per_doubling: 6 }
    }
}

/// Rule for the gel's volume at large strains. At small strains the Poisson ratio determines the
/// volume. For large strains two rules are common besides constant volume.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum VolumeRule {
    /// Constant volume, as for a Poisson ratio of ½.
    Incompressible,
    /// Rule of a rubber network: stretch of the polymer contracts the volume. A pressure
    /// proportional to the volume's change, with Lamé's first modulus, resists and relaxes like the
    /// polymer.
    Network {
        /// Poisson ratio at small strains, below ½.
        poisson_ratio: f64,
    },
    /// Shape and volume resist separately. The polymer's stretch does not depend on the volume, and
    /// only the bulk modulus resists a change of the volume.
    Decoupled {
        /// Poisson ratio at small strains, below ½.
        poisson_ratio: f64,
    },
}

impl VolumeRule {
    fn poisson_ratio(self) -> f64 {
        match self {
            Self::Incompressible => 0.5,
            Self::Network { poisson_ratio } | Self::Decoupled { poisson_ratio } => poisson_ratio,
        }
    }

    fn giving(self) -> Result<Option<VolumeResistance>> {
        let poisson_ratio = self.poisson_ratio();
        let lame_ratio = 2.0 * poisson_ratio / (1.0 - 2.0 * poisson_ratio);
        match self {
            Self::Incompressible => Ok(None),
            _ if !(poisson_ratio > 0.0 && poisson_ratio < 0.5) => Err(Error::numerical(
                format!("the Poisson ratio of a compressible gel is {poisson_ratio}"),
                "give a Poisson ratio between 0 and 0.5, both excluded",
            )),
            Self::Network { .. } => Ok(Some(VolumeResistance { modulus_ratio: lame_ratio, is_apart: false })),
            Self::Decoupled { .. } => {
                Ok(Some(VolumeResistance { modulus_ratio: lame_ratio + 2.0 / 3.0, is_apart: true }))
            }
        }
    }
}

/// The meshed gel around a body of revolution.
pub struct FiniteGel {
    mesh: FieldMesh,
    /// Radius of the body across its axis, in m. It is the unit of length of the equations.
    radius_m: f64,
    /// Small-strain stiffness: force divided by shear modulus and displacement, in units of the
    /// radius.
    stiffness: f64,
    volume: VolumeRule,
    fineness: Discretisation,
}

/// Input of a run: law, load and record.
#[derive(Debug, Clone, Copy)]
pub struct FiniteInput<'a> {
    /// Law of the gel.
    pub law: &'a FiniteLaw,
    /// Model stages between the commanded force and the force on the body.
    pub load: &'a Load,
    /// Times of the rows in s, ascending.
    pub time_s: &'a [f64],
    /// Commanded force. No force acts before the first row.
    pub force: Force<'a>,
}

/// Displacements that a run returns, with measures of its quality.
#[derive(Debug, Clone, PartialEq)]
pub struct FiniteResult {
    /// Position of the body (m) at every row, just before any force step at the row.
    pub displacement_m: Vec<f64>,
    /// Displacement (m) at every row, minus the displacement in an equal gel with small strains.
    pub deviation_m: Vec<f64>,
    /// Largest distance of the body from its start, in m.
    pub farthest_m: f64,
    /// Smallest and largest ratio of deformed to undeformed volume at any point. In an
    /// incompressible gel both would be 1 on an infinitely fine mesh.
    pub volume_ratios: [f64; 2],
    /// Number of steps, of Newton iterations and of factorisations.
    pub cost: [usize; 3],
}

impl FiniteGel {
    /// Meshes the gel between a sphere and the fixed sphere around it. Lengths are in m.
    ///
    /// # Errors
    /// [`Error::Numerical`] if the sphere does not lie inside the fixed one.
    pub fn around_sphere(radius_m: f64, outer_radius_m: f64, fineness: Discretisation) -> Result<Self> {
        Self::new(BodyOfRevolution::sphere(radius_m), outer_radius_m, VolumeRule::Incompressible, fineness)
    }

    /// Meshes the gel between a body that is pulled along its axis and the fixed sphere around it.
    /// Lengths are in m.
    ///
    /// # Errors
    /// [`Error::Numerical`] if the body does not lie inside the sphere, or if a Poisson ratio lies
    /// outside (0, ½).
    pub fn new(
        body: BodyOfRevolution,
        outer_radius_m: f64,
        volume: VolumeRule,
        fineness: Discretisation,
    ) -> Result<Self> {
        let [across_m, along_m, around_m] = body.extents_m();
        if !(across_m > 0.0 && along_m > 0.0 && outer_radius_m > around_m && outer_radius_m.is_finite()) {
            return Err(Error::numerical(
                format!("no mesh fits between {body:?} and a sphere of radius {outer_radius_m} m"),
                "give a robot that lies inside the vitreous",
            ));
        }
        let outer = outer_radius_m / across_m;
        let mesh = match body {
            BodyOfRevolution::Spheroid { .. } if across_m == along_m => concentric(outer, fineness),
            _ => body.scaled(1.0 / across_m).mesh(outer, RIM_LAYERS).whole(),
        };
        let mesh = FieldMesh::new(&mesh, fineness.order, volume.giving()?)?;
        let stiffness = stiffness(&mesh)?;
        Ok(Self { mesh, radius_m: across_m, stiffness, volume, fineness })
    }

    /// Number of displacement and pressure unknowns.
    pub fn n_unknowns(&self) -> usize {
        self.mesh.n_unknowns
    }

    /// Small-strain stiffness: force divided by displacement and shear modulus, in m.
    pub fn stiffness_m(&self) -> f64 {
        self.stiffness * self.radius_m
    }

    /// Computes the motion of the body through a record.
    ///
    /// # Errors
    /// [`Error::Numerical`] if the load depends on the position, the mesh fails, or no balance is
    /// found. In the last two cases the error states the time and the distance reached.
    pub fn run(&self, what: &FiniteInput) -> Result<FiniteResult> {
        let (result, stopped) = self.run_until_failure(what)?;
        stopped.map_or(Ok(result), Err)
    }

    /// Computes the motion of the body through a record as long as the mesh is valid. Returns the
    /// results at the rows until then, and the error that ended the run early, if any.
    ///
    /// # Errors
    /// [`Error::Numerical`] if the load depends on the position.
    pub fn run_until_failure(&self, what: &FiniteInput) -> Result<(FiniteResult, Option<Error>)> {
        let FiniteInput { law, load, time_s, force } = *what;
        let load = load.of::<f64>();
        if load.depends_on_position() {
            return Err(Error::numerical(Spatial::EXCLUDES_FEEDBACK, "remove the gradient of the force"));
        }
        let Some(&end_s) = time_s.last() else {
            let nothing = FiniteResult {
                displacement_m: Vec::new(),
                deviation_m: Vec::new(),
                farthest_m: 0.0,
                volume_ratios: [1.0; 2],
                cost: [0; 3],
            };
            return Ok((nothing, None));
        };
        let pull = AppliedForce {
            switches: &load.switches(time_s, force),
            load: &load,
            newtons_per_pa: self.radius_m * self.radius_m,
            end_s,
        };
        let law = law.of_poisson_ratio(self.volume.poisson_ratio());
        let walked = run_pull(&self.mesh, &law, self.stiffness, &pull, self.fineness.steps_per_doubling);
        let reached_s = match &walked.stopped {
            None => f64::INFINITY,
            Some(_) => walked.legs.last().and_then(|leg| leg.last()).map_or(f64::NEG_INFINITY, |last| last.time_s),
        };
        let time_s = &time_s[..time_s.partition_point(|row_s| *row_s <= reached_s)];
        let result = FiniteResult {
            displacement_m: at_rows(&walked.legs, time_s, self.radius_m, |moment| moment.place),
            deviation_m: at_rows(&walked.legs, time_s, self.radius_m, |moment| moment.place - moment.twin),
            farthest_m: walked.farthest * self.radius_m,
            volume_ratios: walked.volume_ratios,
            cost: [walked.legs.iter().map(|leg| leg.len() - 1).sum(), walked.iterations, walked.factorisations],
        };
        Ok((result, walked.stopped))
    }
}

/// Number of layers of cells around the rim of a cylinder.
const RIM_LAYERS: usize = 2;
/// Exponent of the layers' grading: ln r of surface k of n is proportional to k/n to this power,
/// with the radius r. Layers are thus thin near the body, where strains are large.
const GRADING: f64 = 1.5;

/// Meshes the space between a sphere of radius 1 and a concentric sphere, layer by layer.
fn concentric(outer_radius: f64, fineness: Discretisation) -> Mesh {
    let n_angles = fineness.n_angles;
    // Angles at the ends are exact, so that the vertices lie on the axis.
    let angle = |k: usize| FRAC_PI_2 * (n_angles as f64 - 2.0 * k as f64) / n_angles as f64;
    let angles_rad: Vec<f64> = (0..=n_angles).map(angle).collect();
    let n_layers = (outer_radius.ln() / fineness.layer_ratio.ln()).ceil().max(1.0) as usize;
    let mut mesh = Mesh { is_whole: true, ..Mesh::default() };
    let mut inner = None;
    for layer in 0..=n_layers {
        let radius = outer_radius.powf((layer as f64 / n_layers as f64).powf(GRADING));
        let surface = Boundary { body: layer == 0, outer: layer == n_layers, ..Boundary::INSIDE };
        let chain = mesh.arcs([0.0; 2], [radius; 2], &angles_rad, surface);
        if let Some(inner) = inner.replace(chain.clone()) {
            mesh.rule(&inner, &chain);
        }
    }
    mesh
}

/// Small-strain stiffness: force on the body for unit displacement and unit shear modulus.
fn stiffness(mesh: &FieldMesh) -> Result<f64> {
    let start = vec![0.0; mesh.n_unknowns];
    let configurations: Vec<_> = mesh.cells.iter().map(|cell| vec![AT_REST; cell.shape.weights.len()]).collect();
    let stage = FieldStage {
        force_pa: 1.0,
        law: StageLaw {
            rate_per_s: 1.0,
            solvent_pa_s: 0.0,
            mobility: 0.0,
            modes: &[(1.0, 0.0)],
            volume_compliance_per_pa: mesh.volume.map_or(0.0, |volume| 1.0 / volume.modulus_ratio),
            bulk_pa_s: 0.0,
            is_apart: mesh.volume.is_some_and(|volume| volume.is_apart),
        },
        start: &start,
        configurations: &configurations,
        rests: &[],
    };
    Ok(1.0 / Solver::new(mesh).linear(&stage)?[BODY])
}

/// Number of time points through which a polynomial interpolates the value at a row.
const N_NEAREST: usize = 4;

/// Interpolates `length_m` × `of`(moment) at every row, by polynomials of degree 3 in time within
/// one hold.
fn at_rows(legs: &[Vec<Moment>], time_s: &[f64], length_m: f64, of: impl Fn(&Moment) -> f64) -> Vec<f64> {
    let at = |&row_s: &f64| {
        let ends = |leg: &Vec<Moment>| leg.last().map_or(f64::INFINITY, |moment| moment.time_s);
        let Some(leg) = legs.get(legs.partition_point(|leg| ends(leg) < row_s)).or(legs.last()) else { return 0.0 };
        let after = leg.partition_point(|moment| moment.time_s < row_s);
        // The first row is itself a moment. Before the force's first switch nothing moves.
        if after == 0 {
            return length_m * of(&leg[0]);
        }
        let first = after.saturating_sub(N_NEAREST / 2).min(leg.len().saturating_sub(N_NEAREST));
        let near = &leg[first..leg.len().min(first + N_NEAREST)];
        let times_s: Vec<f64> = near.iter().map(|moment| moment.time_s).collect();
        let weighed = lagrange(&times_s, row_s).into_iter().zip(near).map(|((weight, _), moment)| weight * of(moment));
        length_m * weighed.sum::<f64>()
    };
    time_s.iter().map(at).collect()
}
