//! Surrogate of large displacements for one record. It fits a few time modes with polynomial amplitudes to full-order runs of
//! similar gels.
//!
//! A full-order run takes seconds. There is therefore one box, around the law that fits the record with small strains. By similarity, the
//! deviation from the linear model depends on the ratios of the law's numbers and on the force divided by a modulus. The third power of
//! this force is factored out, so that the polynomials are functions of its square. A free mobility is one more coordinate. Differences
//! between the commanded and the acting force enter to first order. For this, each parameter of the load has one run at the law of the
//! box's centre. Changing the force by a few hundredths changes the deviation by three times that fraction, and second-order terms are
//! negligible. Ratios outside the box are moved to its faces, because data with such ratios are far from the record.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::chart::{Surface, Trained};
use super::coordinates::{first_body, read, with_numbers};
use super::polynomial::Basis;
use crate::model::Response;
use base::error::{Error, Result};
use base::number::{Dual, Scalar};
use elements::fe::oldroyd::{Discretisation, FiniteGel, FiniteInput, FiniteLaw};
use laws::rheology::Element;
use laws::stages::{FieldStepper, Load, LoadParameter, LoadUnit, Spatial, Stages};
use record::{Force, OwnedForce};

/// Half the width of the box in the logarithm of each ratio of the law's numbers.
const HALF_WIDTH: f64 = 0.2;
/// Step to which the logarithms of the ratios at the box's centre are rounded. Fits that differ by little then share their runs.
const CENTRE_STEP: f64 = 0.05;
/// Largest trained displacement of an Oldroyd-B fluid, in robot radii. It is the displacement that the linear law at the box's centre would
/// have.
pub const MAX_RADII: f64 = 4.6;
/// Ratio of the largest trained displacement to the linear displacement in the record, for fluids other than Oldroyd-B. Such fluids move
/// farther than linear ones.
const BEYOND_OWN: f64 = 1.2;
/// Largest mobility in a surrogate for all mobilities. With a larger mobility, the mesh can follow the robot no farther than the robot of
/// the paper moves.
pub const MAX_MOBILITY: f64 = 0.03;
/// Smallest trained square of the force, divided by the largest trained square. Below this square the deviation is almost 0, but the errors
/// of runs are not.
const LEAST_SQUARE: f64 = 0.02;
/// Weighted total degree of the polynomials. It allows the third power of the squared force, squares of the law's ratios, and a ratio times
/// the second power of the squared force.
const DEGREE: f64 = 3.4;
/// Weight of a degree in one of the law's ratios, relative to a degree in the squared force.
const RATIO_WEIGHT: f64 = 1.3;
const MOBILITY_WEIGHT: f64 = 1.2;
/// Ratio of the number of training points to the number of polynomials.
const OVERSAMPLING: f64 = 1.15;
/// Number of full-order runs that check the polynomials.
const N_CHECKS: u32 = 3;
/// Largest residual of the training trajectories after their projection on the time modes, relative to the displacement.
const TOLERANCE: f64 = 2e-4;
/// Largest accepted error at the check runs, relative to the displacement.
const LARGEST_ERROR: f64 = 1e-3;

/// Mobilities that the training covers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum MobilityRange {
    /// One fixed mobility.
    Held(f64),
    /// All mobilities from 0 to [`MAX_MOBILITY`].
    Free,
}

impl MobilityRange {
    /// Mobility of the Oldroyd-B fluid.
    pub const OLDROYD_B: Self = Self::Held(0.0);
}

/// Step for the derivative by a factor of the force, or by the force's offset divided by the largest force.
const FACTOR_STEP: f64 = 0.03;
/// Step in s for the derivative by a time of the load.
const TIME_STEP_S: f64 = 0.03;

/// Returns the step for the derivative by a parameter of the load, under commands up to `largest_n` (N).
fn step(number: &LoadParameter, largest_n: f64) -> f64 {
    match number.unit {
        LoadUnit::Factor => FACTOR_STEP,
        LoadUnit::Force => FACTOR_STEP * largest_n,
        LoadUnit::Time => TIME_STEP_S,
    }
}

/// Range of models that the training covers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LargeScope {
    /// Mobilities that the training covers.
    pub mobilities: MobilityRange,
    /// `true` if the acting force may differ from the commanded one.
    pub with_load: bool,
}

/// Trained surrogate of large displacements for one record.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LargeSurface {
    /// Logarithms of the law's other numbers divided by the first body's modulus, at the middle of the box.
    centre: Vec<f64>,
    /// Squared ratio (1/Pa²) of the effect's amplitude to the first body's modulus, at the box's end.
    largest_per_pa2: f64,
    /// Displacement that the linear law has at the box's end, in robot radii.
    farthest_radii: f64,
    mobilities: MobilityRange,
    /// Changes of the deviation from the linear model for a unit of each parameter of the load (outer) at each row (inner). The unit is
    /// that of the trained deviation. Empty if the force acts as commanded.
    by_load: Vec<Vec<f64>>,
    surface: Surface,
}

/// Moduli and viscosities of a law, divided by the modulus of its first body.
struct Ratios {
    modulus_pa: Dual,
    ln: Vec<Dual>,
    first: usize,
}

impl Ratios {
    fn of(law: &[Element]) -> Option<Self> {
        let (mut shape, mut numbers) = (Vec::new(), Vec::new());
        read(law, &mut shape, &mut numbers)?;
        let first = first_body(&shape).unwrap_or(0);
        let modulus_pa = *numbers.get(first)?;
        let others = numbers.iter().enumerate().filter(|(k, _)| *k != first);
        Some(Self { modulus_pa, ln: others.map(|(_, number)| (*number / modulus_pa).ln()).collect(), first })
    }

    /// Returns the logarithms of the ratios, rounded to multiples of [`CENTRE_STEP`], as the middle of the box.
    fn centre(&self) -> Vec<f64> {
        self.ln.iter().map(|ln| (ln.value / CENTRE_STEP).round() * CENTRE_STEP).collect()
    }

    /// Returns the logarithm of the modulus, rounded to a multiple of [`CENTRE_STEP`].
    fn modulus_step(&self) -> f64 {
        (self.modulus_pa.value.ln() / CENTRE_STEP).round() * CENTRE_STEP
    }

    /// Returns a law with the structure of `like`, whose first body has unit modulus and whose ratios have these logarithms.
    fn law(&self, like: &[Element], ln: &[f64]) -> Option<Vec<Element>> {
        let mut values: Vec<f64> = ln.iter().map(|x| x.exp()).collect();
        values.insert(self.first, 1.0);
        with_numbers(like, &mut values.into_iter())
    }
}

fn basis(n_ratios: usize, mobilities: MobilityRange) -> Option<Basis> {
    let mut weights = vec![RATIO_WEIGHT; n_ratios];
    if mobilities == MobilityRange::Free {
        weights.push(MOBILITY_WEIGHT);
    }
    weights.push(1.0);
    Basis::weighted(&weights, DEGREE, OVERSAMPLING, N_CHECKS)
}

fn no_law() -> Error {
    Error::numerical(
        "large displacements cannot be computed for this law's elements",
        "use springs and dashpots, in series and in parallel",
    )
}

impl LargeSurface {
    /// Number of full-order runs for training the surrogate of a law.
    pub fn n_runs(law: &[Element], scope: LargeScope) -> usize {
        let basis = Ratios::of(law).and_then(|ratios| basis(ratios.ln.len(), scope.mobilities));
        let of_load = if scope.with_load { 1 + LoadParameter::ALL.len() } else { 0 };
        basis.map_or(0, |basis| basis.checks.len() + basis.design.len() + of_load)
    }

    /// Returns the numbers that identify the box of a law. Laws of one box share the trained surrogate.
    ///
    /// # Errors
    /// [`Error::Numerical`] for springpots.
    pub fn place(law: &[Element], scope: LargeScope) -> Result<Vec<f64>> {
        let ratios = Ratios::of(law).ok_or_else(no_law)?;
        let mut place = ratios.centre();
        if scope.mobilities != MobilityRange::OLDROYD_B {
            place.push(ratios.modulus_pa.value);
        } else if scope.with_load {
            place.push(ratios.modulus_step());
        }
        Ok(place)
    }

    /// Trains the surrogate around a law, for the radii of robot and container (m) and a record. It calls `piece_done` after
    /// every run, from any thread.
    ///
    /// # Errors
    /// [`Error::Numerical`] if the robot moves too far, a run fails, or the error at the check runs is too large.
    pub fn learn(
        [radius_m, outer_radius_m]: [f64; 2],
        (law, scope): (&[Element], LargeScope),
        time_s: &[f64],
        force: Force<'_>,
        piece_done: &(dyn Fn() + Sync),
    ) -> Result<Self> {
        let ratios = Ratios::of(law).ok_or_else(no_law)?;
        let (centre, mobilities) = (ratios.centre(), scope.mobilities);
        let basis = basis(centre.len(), mobilities).ok_or_else(no_law)?;
        let gel = FiniteGel::around_sphere(radius_m, outer_radius_m, Discretisation::ESTIMATE)?;
        let at_centre = Stages::of_law(ratios.law(law, &centre).ok_or_else(no_law)?);
        let linear_m = Response::new(time_s, force, time_s.len()).trajectory_m(&at_centre, 3.0 / gel.stiffness_m())?;
        let amplitude_m = linear_m.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        let own_radii = amplitude_m / (radius_m * ratios.modulus_pa.value);
        let farthest_radii = match mobilities {
            MobilityRange::OLDROYD_B => MAX_RADII,
            _ => MAX_RADII.min(BEYOND_OWN * own_radii),
        };
        let largest_per_pa2 = (farthest_radii * radius_m / amplitude_m).powi(2);
        if own_radii.is_nan() || own_radii >= MAX_RADII {
            return Err(Error::numerical(
                format!(
                    "the robot moves by {own_radii:.1} of its radii, but large displacements are computed only up to {MAX_RADII} radii"
                ),
                "leave `large-displacement` out, or use a smaller force",
            ));
        }
        // `deviation_m` returns the deviation from the linear model in m at every row. The load's offset is given for a scale of 1.
        let deviation_m = |elements: &[Element], mobility: f64, load: &Load, scale: f64| -> Result<Vec<f64>> {
            let law = FiniteLaw::new(elements, mobility).ok_or_else(no_law)?;
            let load = load.for_scaled_commands(scale);
            let scaled_n: Vec<f64> = force.at_rows_n.iter().map(|force_n| scale * force_n).collect();
            let force = Force { at_rows_n: &scaled_n, ..force };
            let run = gel.run(&FiniteInput { law: &law, load: &load, time_s, force })?;
            piece_done();
            Ok(run.deviation_m)
        };
        let run = |point: &Vec<f64>| -> Result<Trained> {
            let (square, ln) = point.split_last().ok_or_else(no_law)?;
            let mobility = match mobilities {
                MobilityRange::Held(mobility) => mobility,
                MobilityRange::Free => 0.5 * MAX_MOBILITY * (1.0 + ln[centre.len()]),
            };
            let ln: Vec<f64> = ln.iter().zip(&centre).map(|(x, middle)| middle + HALF_WIDTH * x).collect();
            let share = LEAST_SQUARE + (1.0 - LEAST_SQUARE) * 0.5 * (1.0 + square);
            let scale = (share * largest_per_pa2).sqrt();
            let elements = ratios.law(law, &ln).ok_or_else(no_law)?;
            let deviation_m = deviation_m(&elements, mobility, &Load::COMMANDED, scale)?;
            let cubed = scale.powi(3);
            Ok((deviation_m.iter().map(|x| x / cubed).collect(), amplitude_m / scale.powi(2)))
        };
        let points: Vec<&Vec<f64>> = basis.checks.iter().chain(&basis.design).collect();
        let runs: Vec<Trained> = points.into_par_iter().map(run).collect::<Result<_>>()?;
        let surface = Surface::new(&[basis], 0, TOLERANCE, &runs.iter().collect::<Vec<_>>());
        if surface.certified.is_nan() || surface.certified >= LARGEST_ERROR {
            return Err(Error::numerical(
                format!(
                    "the trained model of large displacements differs from full-order runs by {:.1e} of the displacement",
                    surface.certified
                ),
                "leave `large-displacement` out, or use a smaller force",
            ));
        }
        let by_load = if scope.with_load {
            let elements = ratios.law(law, &centre).ok_or_else(no_law)?;
            let scale = (-ratios.modulus_step()).exp();
            let mobility = match mobilities {
                MobilityRange::Held(mobility) => mobility,
                MobilityRange::Free => 0.5 * MAX_MOBILITY,
            };
            let largest_n = force.at_rows_n.iter().fold(0.0_f64, |most, force_n| most.max(force_n.abs()));
            let sizes = LoadParameter::ALL.map(|number| step(&number, largest_n));
            let loads: Vec<Load> = std::iter::once(Load::COMMANDED)
                .chain(LoadParameter::ALL.into_iter().zip(sizes).map(|(number, size)| number.alone(size)))
                .collect();
            let run = |load: &Load| deviation_m(&elements, mobility, load, scale);
            let runs: Vec<Vec<f64>> = loads.par_iter().map(run).collect::<Result<_>>()?;
            let slope = |(moved, size): (&Vec<f64>, f64)| {
                moved.iter().zip(&runs[0]).map(|(to, from)| (to - from) / (size * scale.powi(3))).collect()
            };
            runs[1..].iter().zip(sizes).map(slope).collect()
        } else {
            Vec::new()
        };
        Ok(Self { centre, largest_per_pa2, farthest_radii, mobilities, by_load, surface })
    }

    /// Largest difference from the full-order runs that were not used for training, relative to the displacement.
    pub fn certified(&self) -> f64 {
        self.surface.certified
    }
}

/// Stepper that evaluates a trained surrogate of large displacements.
#[derive(Debug)]
pub struct LargeStepper {
    learnt: LargeSurface,
    bases: [Basis; 1],
    time_s: Vec<f64>,
    force: OwnedForce,
}

impl LargeStepper {
    /// Returns a stepper for the record of the training.
    ///
    /// # Errors
    /// [`Error::Numerical`] if the surrogate was trained by another version of the program.
    pub fn new(learnt: LargeSurface, time_s: &[f64], force: Force<'_>) -> Result<Self> {
        let bases = [basis(learnt.centre.len(), learnt.mobilities).ok_or_else(no_law)?];
        Ok(Self { learnt, bases, time_s: time_s.to_vec(), force: force.into() })
    }

    fn excess<N: Scalar>(
        &self,
        stages: &Stages,
        time_s: &[f64],
        force: Force<'_>,
        of: impl Fn(Dual) -> N,
    ) -> Result<Vec<N>> {
        let n_rows = time_s.len();
        let is_own = self.time_s.get(..n_rows) == Some(time_s)
            && self.force.get().first(force.at_rows_n.len()) == force
            && (!self.learnt.by_load.is_empty() || stages.load.is_commanded())
            && !stages.load.depends_on_position();
        let (Some(Spatial::Large { amplitude, mobility }), true) = (&stages.spatial, is_own) else {
            return Err(Error::numerical(
                "the model of large displacements was trained for another record, or for the commanded force only",
                "train it for this record and force",
            ));
        };
        let LargeSurface { centre, largest_per_pa2, farthest_radii, mobilities, by_load, surface } = &self.learnt;
        let is_learnt = match mobilities {
            MobilityRange::Held(held) => mobility.is_constant(*held),
            MobilityRange::Free => mobility.value <= MAX_MOBILITY,
        };
        if !is_learnt {
            return Err(Error::numerical(
                format!("a mobility of {} was not learnt", mobility.value),
                format!("fix the mobility at a value, or stay below {MAX_MOBILITY}"),
            ));
        }
        let ratios = Ratios::of(&stages.law).filter(|ratios| ratios.ln.len() == centre.len()).ok_or_else(no_law)?;
        let scale = *amplitude / ratios.modulus_pa;
        let square = scale * scale;
        if square.value.is_nan() || square.value > *largest_per_pa2 {
            return Err(Error::numerical(
                format!("large displacements of {farthest_radii:.1} radii and more cannot be computed"),
                "use a smaller amplitude, or a stiffer gel",
            ));
        }
        let inside = |x: Dual| if x.value.abs() <= 1.0 { x } else { Dual::constant(x.value.clamp(-1.0, 1.0)) };
        let ln = ratios.ln.iter().zip(centre).map(|(x, middle)| (*x - Dual::constant(*middle)) * (1.0 / HALF_WIDTH));
        let share = square * (1.0 / largest_per_pa2);
        let square_place = (share - Dual::constant(LEAST_SQUARE)) * (2.0 / (1.0 - LEAST_SQUARE)) - Dual::ONE;
        let is_free = *mobilities == MobilityRange::Free;
        let mobility_place = is_free.then(|| *mobility * (2.0 / MAX_MOBILITY) - Dual::ONE);
        let place: Vec<N> = ln.chain(mobility_place).chain([square_place]).map(|x| of(inside(x))).collect();
        let factor = square / ratios.modulus_pa;
        let mut excess_m = surface.excess_m(&self.bases, &place, of(factor), n_rows);
        for (number, slope) in LoadParameter::ALL.into_iter().zip(by_load) {
            let by = number.of(&stages.load) * factor;
            if !by.is_constant(0.0) {
                let by = of(by);
                excess_m.iter_mut().zip(slope).for_each(|(x, slope)| *x += by * *slope);
            }
        }
        Ok(excess_m)
    }
}

impl FieldStepper for LargeStepper {
    fn excess_m(&self, stages: &Stages, _compliance_per_m: f64, time_s: &[f64], force: Force<'_>) -> Result<Vec<f64>> {
        self.excess(stages, time_s, force, |x| x.value)
    }

    fn excess_dual_m(
        &self,
        stages: &Stages,
        _compliance_per_m: f64,
        time_s: &[f64],
        force: Force<'_>,
    ) -> Result<Vec<Dual>> {
        self.excess(stages, time_s, force, |x| x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use laws::rheology::BaseLaw;

    /// Scope of an Oldroyd-B fluid under the commanded force.
    const COMMANDED: LargeScope = LargeScope { mobilities: MobilityRange::OLDROYD_B, with_load: false };

    /// Checks the bead of the paper over one cycle, at the paper's law and amplitude and at laws and amplitudes that were not used for
    /// training. The reference is full-order runs on a finer mesh with finer time steps. Derivatives are compared with differences.
    #[test]
    #[ignore = "thorough"]
    fn what_is_learnt_is_what_full_runs_find() {
        const RADII_M: [f64; 2] = [0.275e-3, 10e-3];
        let time_s: Vec<f64> = (0..=40).map(|row| 0.25 * f64::from(row)).collect();
        let force_n: Vec<f64> = (0..=40).map(|row| if row < 20 { 4.6e-6 } else { -4.6e-6 }).collect();
        let force = Force::from(&force_n);
        let law = |p: [f64; 3]| BaseLaw::Lethersich.elements(&p.map(Dual::constant));
        let entry = [3.527, 1.402, 47.370];
        let learnt = LargeSurface::learn(RADII_M, (&law(entry), COMMANDED), &time_s, force, &|| ());
        let learnt = learnt.expect("learns");
        println!("{} runs, certified {:.1e}", LargeSurface::n_runs(&law(entry), COMMANDED), learnt.certified());
        assert!(learnt.certified() < LARGEST_ERROR);
        let stepper = LargeStepper::new(learnt, &time_s, force).expect("a basis");
        let gel = FiniteGel::around_sphere(RADII_M[0], RADII_M[1], Discretisation::default()).expect("a mesh");
        let stages = |p: [Dual; 3], amplitude: Dual| {
            let mut stages = Stages::of_law(BaseLaw::Lethersich.elements(&p));
            stages.spatial = Some(Spatial::Large { amplitude, mobility: Dual::ZERO });
            stages
        };
        for (p, amplitude) in [(entry, 1.0), ([3.6, 1.25, 52.0], 0.8), ([3.3, 1.5, 41.0], 0.5)] {
            let found = stepper
                .excess_m(&stages(p.map(Dual::constant), amplitude.into()), 1.0, &time_s, force)
                .expect("learnt");
            let larger_n: Vec<f64> = force_n.iter().map(|f| amplitude * f).collect();
            let finite = FiniteLaw::new(&law(p), 0.0).expect("no springpot");
            let load = Stages::of_law(Vec::new()).load;
            let what = FiniteInput { law: &finite, load: &load, time_s: &time_s, force: Force::from(&larger_n) };
            let exact = gel.run(&what).expect("a run").deviation_m;
            let apart_um = found.iter().zip(&exact).fold(0.0_f64, |m, (a, b)| m.max(1e6 * (a - b / amplitude).abs()));
            println!("{p:?} at {amplitude}: {apart_um:.3} µm");
            assert!(apart_um < 0.4, "{p:?} at {amplitude}: {apart_um}");
        }
        for seeded in 0..4 {
            let at = |step: f64| {
                let mut values = [entry[0], entry[1], entry[2], 0.9];
                values[seeded] *= 1.0 + step;
                let dual = |k: usize| if k == seeded { Dual::variable(values[k]) } else { Dual::constant(values[k]) };
                let stages = stages([dual(0), dual(1), dual(2)], dual(3));
                (values[seeded], stepper.excess_dual_m(&stages, 1.0, &time_s, force).expect("learnt"))
            };
            let ((up, above), (down, below), (_, here)) = (at(1e-5), at(-1e-5), at(0.0));
            let largest = here.iter().fold(0.0_f64, |most, x| most.max(x.derivative.abs()));
            for k in 0..time_s.len() {
                let slope = (above[k].value - below[k].value) / (up - down);
                assert!((slope - here[k].derivative).abs() < 1e-6 * largest, "{seeded} {k}: {slope} {:?}", here[k]);
            }
        }
    }

    /// Compares the surrogate with full-order runs on a finer mesh with finer time steps, at two amplitudes and at mobilities
    /// between those of the training.
    #[test]
    #[ignore = "campaigns/long-tests"]
    fn free_mobilities_are_what_full_runs_find() {
        const RADII_M: [f64; 2] = [0.275e-3, 10e-3];
        let time_s: Vec<f64> = (0..=40).map(|row| 0.25 * f64::from(row)).collect();
        let force_n: Vec<f64> = (0..=40).map(|row| if row < 20 { 3.5e-6 } else { -3.5e-6 }).collect();
        let force = Force::from(&force_n);
        let law = BaseLaw::Lethersich.elements(&[3.527, 1.402, 47.370].map(Dual::constant));
        let scope = LargeScope { mobilities: MobilityRange::Free, with_load: false };
        let learnt = LargeSurface::learn(RADII_M, (&law, scope), &time_s, force, &|| ()).expect("learns");
        println!("{} runs, certified {:.1e}", LargeSurface::n_runs(&law, scope), learnt.certified());
        let stepper = LargeStepper::new(learnt, &time_s, force).expect("a basis");
        let gel = FiniteGel::around_sphere(RADII_M[0], RADII_M[1], Discretisation::default()).expect("a mesh");
        let excess_m = |amplitude: f64, mobility: Dual| {
            let mut stages = Stages::of_law(law.clone());
            stages.spatial = Some(Spatial::Large { amplitude: amplitude.into(), mobility });
            stepper.excess_dual_m(&stages, 1.0, &time_s, force)
        };
        for (amplitude, mobility) in [(1.0, 0.0), (1.0, 0.011), (0.9, 0.027)] {
            let found = excess_m(amplitude, Dual::variable(mobility)).expect("learnt");
            let larger_n: Vec<f64> = force_n.iter().map(|f| amplitude * f).collect();
            let finite = FiniteLaw::new(&law, mobility).expect("no springpot");
            let load = Stages::of_law(Vec::new()).load;
            let what = FiniteInput { law: &finite, load: &load, time_s: &time_s, force: Force::from(&larger_n) };
            let exact = gel.run(&what).expect("a run").deviation_m;
            let apart = |(found, exact): (&Dual, &f64)| 1e6 * (found.value - exact / amplitude).abs();
            let apart_um = found.iter().zip(&exact).map(apart).fold(0.0, f64::max);
            println!("{amplitude}, {mobility}: {apart_um:.3} µm");
            assert!(apart_um < 0.4, "{amplitude}, {mobility}: {apart_um}");
        }
        let (up, down) = (excess_m(1.0, 0.0111.into()).expect("learnt"), excess_m(1.0, 0.0109.into()).expect("learnt"));
        for ((up, down), here) in up.iter().zip(&down).zip(excess_m(1.0, Dual::variable(0.011)).expect("learnt")) {
            let slope = (up.value - down.value) / 2e-4;
            assert!((slope - here.derivative).abs() < 1e-6, "{slope} {here:?}");
        }
        assert!(
            excess_m(1.0, 0.04.into())
                .is_err_and(|error| error.to_string().contains("a mobility of 0.04 was not learnt"))
        );
    }

    /// Compares the surrogate with full-order runs on a finer mesh, for each parameter of the load and for all parameters together. Factors
    /// and offset are changed by a few hundredths, and times by hundredths of a second. These changes alter the deviation by 12 µm, which
    /// the surrogate gives to one or two tenths of a µm.
    #[test]
    #[ignore = "thorough"]
    fn loads_are_followed_to_first_order() {
        const RADII_M: [f64; 2] = [0.275e-3, 10e-3];
        let time_s: Vec<f64> = (0..=40).map(|row| 0.25 * f64::from(row)).collect();
        let force_n: Vec<f64> = (0..=40).map(|row| if row < 20 { 3.5e-6 } else { -3.5e-6 }).collect();
        let force = Force::from(&force_n);
        let law = BaseLaw::Lethersich.elements(&[3.527, 1.402, 47.370].map(Dual::constant));
        let scope = LargeScope { with_load: true, ..COMMANDED };
        let learnt = LargeSurface::learn(RADII_M, (&law, scope), &time_s, force, &|| ()).expect("learns");
        let stepper = LargeStepper::new(learnt, &time_s, force).expect("a basis");
        let gel = FiniteGel::around_sphere(RADII_M[0], RADII_M[1], Discretisation::default()).expect("a mesh");
        let finite = FiniteLaw::new(&law, 0.0).expect("no springpot");
        let exact_m = |load: &Load| {
            let what = FiniteInput { law: &finite, load, time_s: &time_s, force };
            gel.run(&what).expect("a run").deviation_m
        };
        let found_m = |load: &Load| {
            let mut stages = Stages::of_law(law.clone());
            stages.spatial = Some(Spatial::Large { amplitude: Dual::ONE, mobility: Dual::ZERO });
            stages.load = load.clone();
            stepper.excess_m(&stages, 1.0, &time_s, force).expect("learnt")
        };
        let still = Stages::of_law(Vec::new()).load;
        let (still_exact_m, still_found_m) = (exact_m(&still), found_m(&still));
        let together = Load {
            positive_factor: 0.98.into(),
            offset_n: 0.07e-6.into(),
            delay_s: 0.01.into(),
            lag_time_s: 0.02.into(),
            ..Load::COMMANDED
        };
        let alone = LoadParameter::ALL.map(|number| number.alone(-0.04 * step(&number, 3.5e-6) / FACTOR_STEP));
        let up = [3, 4].map(|time: usize| LoadParameter::ALL[time].alone(0.02));
        let loads = alone[..3].iter().chain(&up).chain([&together]);
        for load in loads {
            let (exact_m, found_m) = (exact_m(load), found_m(load));
            let change = |k: usize| [exact_m[k] - still_exact_m[k], found_m[k] - still_found_m[k]].map(|x| 1e6 * x);
            let most =
                |of: &dyn Fn([f64; 2]) -> f64| (0..time_s.len()).map(|k| of(change(k)).abs()).fold(0.0, f64::max);
            let (changed_um, apart_um) = (most(&|[exact, _]| exact), most(&|[exact, found]| exact - found));
            println!("{load:?}: {apart_um:.3} of {changed_um:.3} µm");
            assert!(apart_um < 0.2 + 0.1 * changed_um, "{load:?}: {apart_um} of {changed_um}");
        }
    }
}
