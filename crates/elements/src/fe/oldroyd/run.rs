//! Time steps of the finite-strain gel and of its twin, an equal gel with small strains. The twin
//! takes equal steps.

use rayon::prelude::*;

use super::field::{BODY, FieldCell, FieldMesh, FieldStage, Solver};
use super::law::FiniteLaw;
use super::point::{self, AT_REST, StageLaw, Symmetric};
use crate::fe::clock::{FOURTH, StepRule};
use crate::fe::meridional::basis::lagrange;
use base::error::{Error, Result};
use laws::stages::{Load, Switch};

/// Range of the ratio of deformed to undeformed volume at a point within which a mesh is valid.
/// Over the paper's four cycles, the ratio is 0.64 to 1.37 on the mesh of
/// [`super::Discretisation::ESTIMATE`]. Positions then have an error of 0.3 µm. At 1.3 times the
/// force, the ratio is 0.26 to 3.6 and the error is 1 µm.
const VOLUME_RATIOS: [f64; 2] = [0.1, 10.0];
/// Length of the first step after a force jump, divided by the shortest time of the law. Without a
/// solvent the body itself jumps.
const FIRST_STEP: f64 = 1e-3;
/// Shortest time that steps resolve after a switch, divided by the shortest time of the law. When
/// the flow reverses, the gel's response varies as fast as the law.
const RESOLVED: f64 = 0.2;
/// Relative rounding error of a step's length.
const LENGTH_ROUNDING: f64 = 1e-9;
/// Largest number of times that a step is halved because it finds no balance.
const MOST_HALVINGS: u32 = 6;
/// Number of times from which the guess for a stage is extrapolated.
const N_GUESS: usize = 4;

/// Result of a run. The unit of length is the body's radius.
pub(super) struct RunHistory {
    /// Recorded positions between two switches of the force, one list per interval: at the start of
    /// the first step, then at the end of each step.
    pub(super) legs: Vec<Vec<Moment>>,
    pub(super) farthest: f64,
    pub(super) volume_ratios: [f64; 2],
    pub(super) iterations: usize,
    pub(super) factorisations: usize,
    /// Error that ended the run early, if any.
    pub(super) stopped: Option<Error>,
}

/// Positions of the body in the finite-strain gel and in its small-strain twin at a time (s).
#[derive(Debug, Clone, Copy)]
pub(super) struct Moment {
    pub(super) time_s: f64,
    pub(super) place: f64,
    pub(super) twin: f64,
}

/// The body in a gel with small strains. It has equal modes and takes equal steps.
#[derive(Debug, Clone)]
struct SmallStrainTwin {
    displacement: f64,
    /// Elastic displacement of every mode, in body radii.
    elastic: Vec<f64>,
}

/// State that passes from one step to the next.
struct Walker<'a> {
    mesh: &'a FieldMesh,
    law: &'a FiniteLaw,
    /// Small-strain stiffness: force divided by shear modulus and displacement, in body radii.
    stiffness: f64,
    solver: Solver<'a>,
    x: Vec<f64>,
    /// Conformations in undeformed coordinates, by cell, point and mode.
    configurations: Vec<Vec<Symmetric>>,
    /// Relaxed part of the relative volume change, by cell, point and mode. Empty if the gel keeps
    /// its volume.
    swellings: Vec<Vec<f64>>,
    twin: SmallStrainTwin,
    /// Times (s) and unknowns since the last switch of the force, for extrapolation.
    past: Vec<(f64, Vec<f64>)>,
}

/// Rates of the state's variables in a stage.
struct Rates {
    x: Vec<f64>,
    configurations: Vec<Vec<Symmetric>>,
    swellings: Vec<Vec<f64>>,
    twin: SmallStrainTwin,
}

/// Force on the body over time.
pub(super) struct AppliedForce<'a> {
    /// Switches of the force (N) at the input of the lag.
    pub switches: &'a [Switch],
    pub(super) load: &'a Load<f64>,
    /// Square of the body's radius, in m²: converts the equations' force (Pa) to N.
    pub(super) newtons_per_pa: f64,
    pub(super) end_s: f64,
}

/// Runs a law until `pull.end_s`, or as long as the mesh is valid.
pub(super) fn run_pull(
    mesh: &FieldMesh,
    law: &FiniteLaw,
    stiffness: f64,
    pull: &AppliedForce,
    steps_per_doubling: u32,
) -> RunHistory {
    let AppliedForce { switches, load, newtons_per_pa, end_s } = *pull;
    let mut walker = Walker::new(mesh, law, stiffness);
    let fastest_s = law.fastest_s.min(load.fastest_s());
    let rule = StepRule::new(steps_per_doubling, RESOLVED * fastest_s, false, 0.0);
    let mut walked = RunHistory {
        legs: Vec::new(),
        farthest: 0.0,
        volume_ratios: [1.0; 2],
        iterations: 0,
        factorisations: 0,
        stopped: None,
    };
    let mut lagged_n = 0.0;
    for (number, switch) in switches.iter().enumerate() {
        let stop_s = switches.get(number + 1).map_or(end_s, |next| next.time_s).min(end_s);
        if switch.time_s >= stop_s {
            continue;
        }
        let force_pa = |time_s: f64| load.after_lag_n(switch, lagged_n, time_s) / newtons_per_pa;
        let grading = rule.after_switch(switch.time_s, stop_s - switch.time_s, switch.jumps);
        let mut now_s = switch.time_s;
        walker.past.clear();
        if !switch.jumps {
            walker.past.push((now_s, walker.x.clone()));
        }
        let mut leg = vec![walker.moment(now_s)];
        while now_s < stop_s {
            let left_s = stop_s - now_s;
            let mut step_s = rule.step_s(grading, now_s, left_s);
            if now_s == switch.time_s && switch.jumps {
                step_s = step_s.min(FIRST_STEP * fastest_s);
            }
            let taken_s = match walker.step_halving(now_s, step_s, &force_pa) {
                Ok(taken_s) => taken_s,
                Err(error) => {
                    walked.stopped = Some(error);
                    break;
                }
            };
            // The last step ends exactly at the stop, in spite of rounding of its length.
            let next_s = if taken_s > (1.0 - LENGTH_ROUNDING) * left_s { stop_s } else { now_s + taken_s };
            let [low, high] = walker.solver.volume_ratios(&walker.x);
            walked.volume_ratios = [walked.volume_ratios[0].min(low), walked.volume_ratios[1].max(high)];
            walked.farthest = walked.farthest.max(walker.x[BODY].abs());
            if !(low > VOLUME_RATIOS[0] && high < VOLUME_RATIOS[1]) {
                walked.stopped = Some(Error::numerical(
                    format!(
                        "the mesh fails at {next_s:.3} s, with the body {:.2} of its radii from its start: volumes that must stay constant changed by factors from {low:.2} to {high:.2}",
                        walker.x[BODY]
                    ),
                    "use a smaller force, a stiffer gel or a finer mesh",
                ));
                break;
            }
            leg.push(walker.moment(next_s));
            now_s = next_s;
        }
        walked.legs.push(leg);
        if walked.stopped.is_some() {
            break;
        }
        lagged_n = load.after_lag_n(switch, lagged_n, stop_s);
    }
    (walked.iterations, walked.factorisations) = (walker.solver.iterations, walker.solver.factorisations);
    walked
}

impl<'a> Walker<'a> {
    fn new(mesh: &'a FieldMesh, law: &'a FiniteLaw, stiffness: f64) -> Self {
        let n_modes = law.modes.len();
        let at_rest = |cell: &FieldCell| vec![AT_REST; cell.shape.weights.len() * n_modes];
        Self {
            mesh,
            law,
            stiffness,
            solver: Solver::new(mesh),
            x: vec![0.0; mesh.n_unknowns],
            configurations: mesh.cells.iter().map(at_rest).collect(),
            swellings: match mesh.volume {
                Some(_) => mesh.cells.iter().map(|cell| vec![0.0; cell.shape.weights.len() * n_modes]).collect(),
                None => Vec::new(),
            },
            twin: SmallStrainTwin { displacement: 0.0, elastic: vec![0.0; n_modes] },
            past: Vec::new(),
        }
    }

    fn moment(&self, time_s: f64) -> Moment {
        Moment { time_s, place: self.x[BODY], twin: self.twin.displacement }
    }

    /// Takes a step, and halves it until a balance is found. Returns the length (s) of the step
    /// taken.
    fn step_halving(&mut self, now_s: f64, step_s: f64, force_pa: &dyn Fn(f64) -> f64) -> Result<f64> {
        for halvings in 0..=MOST_HALVINGS {
            let step_s = step_s * 0.5_f64.powi(halvings as i32);
            if self.step(now_s, step_s, force_pa).is_ok() {
                return Ok(step_s);
            }
        }
        Err(Error::numerical(
            format!(
                "no balance of the gel was found at {now_s:.3} s, with the body {:.2} of its radii from its start",
                self.x[BODY]
            ),
            "use a smaller force, a stiffer gel or a finer mesh",
        ))
    }

    /// Takes one step. Returns the rates (1/s) of the unknowns in the last stage. A failed step
    /// does not change the state.
    fn step(&mut self, now_s: f64, step_s: f64, force_pa: &dyn Fn(f64) -> f64) -> Result<Vec<f64>> {
        let stage_s = FOURTH.diagonal * step_s;
        let modes: Vec<(f64, f64)> =
            self.law.modes.iter().map(|mode| (mode.shear_modulus_pa, stage_s / mode.time_s)).collect();
        let volume = self.mesh.volume;
        let law = StageLaw {
            rate_per_s: 1.0 / stage_s,
            solvent_pa_s: self.law.solvent_pa_s,
            mobility: self.law.mobility,
            modes: &modes,
            volume_compliance_per_pa: volume.map_or(0.0, |volume| 1.0 / (volume.modulus_ratio * stiff_pa(&modes))),
            bulk_pa_s: volume.map_or(0.0, |volume| volume.modulus_ratio * self.law.solvent_pa_s),
            is_apart: volume.is_some_and(|volume| volume.is_apart),
        };
        let mut all: Vec<Rates> = Vec::with_capacity(FOURTH.nodes.len());
        let mut past = self.past.clone();
        let mut last = None;
        for (node, row) in FOURTH.nodes.iter().zip(FOURTH.matrix) {
            let (mut start, mut configurations, mut swellings, mut twin) =
                (self.x.clone(), self.configurations.clone(), self.swellings.clone(), self.twin.clone());
            for (factor, rates) in row.iter().zip(&all) {
                let by = step_s * factor;
                add(&mut start, by, &rates.x);
                let cells = configurations.par_iter_mut().zip(&rates.configurations);
                cells.for_each(|(to, rate)| {
                    to.iter_mut().zip(rate).for_each(|(to, rate)| add(to, by, rate));
                });
                swellings.iter_mut().zip(&rates.swellings).for_each(|(to, rate)| add(to, by, rate));
                twin.displacement += by * rates.twin.displacement;
                add(&mut twin.elastic, by, &rates.twin.elastic);
            }
            let time_s = now_s + node * step_s;
            let force_pa = force_pa(time_s);
            let rests: Vec<Vec<f64>> = swellings.iter().map(|cell| rests(&modes, cell)).collect();
            let stage = FieldStage { force_pa, law, start: &start, configurations: &configurations, rests: &rests };
            let x = self.solver.solve(&stage, guess(&past, time_s).unwrap_or_else(|| self.x.clone()))?;
            if past.len() == N_GUESS {
                past.remove(0);
            }
            past.push((time_s, x.clone()));
            let (ended, rates) = self.ended(&stage, &x, &configurations);
            let (relax_volumes, swelling_rates) = self.relax_volumes(&stage, &x, &swellings);
            let twin_ended = self.twin_ended(&stage, &twin);
            let rate = |to: f64, from: f64| (to - from) / stage_s;
            all.push(Rates {
                x: (0..x.len()).map(|k| if self.mesh.is_pressure(k) { 0.0 } else { rate(x[k], start[k]) }).collect(),
                configurations: rates,
                swellings: swelling_rates,
                twin: SmallStrainTwin {
                    displacement: rate(twin_ended.displacement, twin.displacement),
                    elastic: twin_ended.elastic.iter().zip(&twin.elastic).map(|(to, from)| rate(*to, *from)).collect(),
                },
            });
            last = Some((x, ended, relax_volumes, twin_ended));
        }
        if let Some(last) = last {
            (self.x, self.configurations, self.swellings, self.twin) = last;
        }
        past.retain(|(time_s, _)| *time_s <= now_s || *time_s == now_s + step_s);
        if past.len() == N_GUESS {
            past.remove(0);
        }
        self.past = past;
        Ok(all.pop().map_or(Vec::new(), |rates| rates.x))
    }

    /// Returns the conformations at a stage's end and their rates, both by cell, point and mode.
    fn ended(
        &self,
        stage: &FieldStage,
        x: &[f64],
        starts: &[Vec<Symmetric>],
    ) -> (Vec<Vec<Symmetric>>, Vec<Vec<Symmetric>>) {
        let n_modes = stage.law.modes.len().max(1);
        let law = stage.law;
        let of_cell = |(cell, starts): (&FieldCell, &Vec<Symmetric>)| {
            let f = self.mesh.gradients(cell, x);
            let each = starts.iter().enumerate().map(|(k, start)| {
                let ended =
                    point::configuration(&f[k / n_modes], start, law.modes[k % n_modes].1, law.mobility, law.is_apart);
                let rate: Symmetric = std::array::from_fn(|c| (ended[c] - start[c]) * law.rate_per_s);
                (ended, rate)
            });
            each.unzip()
        };
        self.mesh.cells.par_iter().zip(starts).map(of_cell).unzip()
    }

    /// Returns the relaxed part of the relative volume change at a stage's end and its rate, both
    /// by cell, point and mode.
    fn relax_volumes(&self, stage: &FieldStage, x: &[f64], starts: &[Vec<f64>]) -> (Vec<Vec<f64>>, Vec<Vec<f64>>) {
        let modes = stage.law.modes;
        let of_cell = |(cell, starts): (&FieldCell, &Vec<f64>)| {
            let f = self.mesh.gradients(cell, x);
            let each = starts.iter().enumerate().map(|(k, start)| {
                let z = modes[k % modes.len()].1;
                let ended = (start + z * (point::determinant(&f[k / modes.len()]) - 1.0)) / (1.0 + z);
                (ended, (ended - start) * stage.law.rate_per_s)
            });
            each.unzip()
        };
        self.mesh.cells.iter().zip(starts).map(of_cell).unzip()
    }

    fn twin_ended(&self, stage: &FieldStage, start: &SmallStrainTwin) -> SmallStrainTwin {
        let elastic = stage.law.modes.iter().zip(&start.elastic);
        let carried: f64 = elastic.clone().map(|((modulus_pa, z), e)| modulus_pa * e / (1.0 + z)).sum();
        let stiff_pa = stage.law.solvent_pa_s * stage.law.rate_per_s + stiff_pa(stage.law.modes);
        let by = (stage.force_pa / self.stiffness - carried) / stiff_pa;
        SmallStrainTwin {
            displacement: start.displacement + by,
            elastic: elastic.map(|((_, z), e)| (e + by) / (1.0 + z)).collect(),
        }
    }
}

/// Sum of the modes' effective moduli G/(1 + z) over a stage, in Pa. `modes` holds the modulus G
/// and z, the stage's implicit time divided by the relaxation time.
fn stiff_pa(modes: &[(f64, f64)]) -> f64 {
    modes.iter().map(|(modulus_pa, z)| modulus_pa / (1.0 + z)).sum()
}

/// Relative volume change at zero pressure, at every point of a cell. `swellings` holds its relaxed
/// part by point and mode.
fn rests(modes: &[(f64, f64)], swellings: &[f64]) -> Vec<f64> {
    let weighed =
        |values: &[f64]| modes.iter().zip(values).map(|((modulus_pa, z), x)| modulus_pa / (1.0 + z) * x).sum();
    let stiff_pa = stiff_pa(modes);
    swellings
        .chunks_exact(modes.len().max(1))
        .map(|values| -> f64 { weighed(values) })
        .map(|sum| sum / stiff_pa)
        .collect()
}

fn add(to: &mut [f64], by: f64, from: &[f64]) {
    to.iter_mut().zip(from).for_each(|(to, from)| *to += by * from);
}

/// Value at `time_s` of the polynomial through the points `past`. If the time is farther from the
/// last point than the points are from each other, the last point is returned.
fn guess(past: &[(f64, Vec<f64>)], time_s: f64) -> Option<Vec<f64>> {
    let times_s: Vec<f64> = past.iter().map(|(time_s, _)| *time_s).collect();
    let (last_s, last) = past.last()?;
    let [first_s, end_s] = times_s.iter().fold([*last_s; 2], |[low, high], t| [low.min(*t), high.max(*t)]);
    if time_s - last_s > end_s - first_s {
        return Some(last.clone());
    }
    let mut guess = vec![0.0; last.len()];
    for ((weight, _), (_, x)) in lagrange(&times_s, time_s).into_iter().zip(past) {
        add(&mut guess, weight, x);
    }
    Some(guess)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fe::oldroyd::{Discretisation, concentric, stiffness};
    use base::number::Dual;
    use laws::rheology::BaseLaw;

    /// Returns the stored energy ½ Σ G (tr A − 3) and the dissipated power 2η_s D : D + Σ G (tr
    /// A − 3)/(2λ), both integrated over the gel. Also returns the smallest determinant of S.
    fn energy(walker: &Walker, rates_per_s: &[f64]) -> ([f64; 2], f64) {
        let (mut stored, mut lost, mut smallest) = (0.0, 0.0, f64::INFINITY);
        let modes = &walker.law.modes;
        let still = vec![0.0; walker.x.len()];
        for (cell, configurations) in walker.mesh.cells.iter().zip(&walker.configurations) {
            let f = walker.mesh.gradients(cell, &walker.x);
            let moving = walker.mesh.gradients(cell, rates_per_s);
            let nothing = walker.mesh.gradients(cell, &still);
            for (q, weight) in cell.shape.weights.iter().enumerate() {
                let rate: point::Gradient = std::array::from_fn(|k| moving[q][k] - nothing[q][k]);
                let [a, b, c, d, hoop] = f[q];
                let by = 1.0 / (a * d - b * c);
                let l = [
                    (rate[0] * d - rate[1] * c) * by,
                    (rate[1] * a - rate[0] * b) * by,
                    (rate[2] * d - rate[3] * c) * by,
                    (rate[3] * a - rate[2] * b) * by,
                ];
                let square = l[0].powi(2) + l[3].powi(2) + 0.5 * (l[1] + l[2]).powi(2) + (rate[4] / hoop).powi(2);
                lost += weight * 2.0 * walker.law.solvent_pa_s * square;
                for (mode, s) in modes.iter().zip(&configurations[q * modes.len()..]) {
                    let trace = s[0] * (a * a + c * c)
                        + 2.0 * s[1] * (a * b + c * d)
                        + s[2] * (b * b + d * d)
                        + s[3] * hoop * hoop;
                    stored += weight * 0.5 * mode.shear_modulus_pa * (trace - 3.0);
                    lost += weight * 0.5 * mode.shear_modulus_pa * (trace - 3.0) / mode.time_s;
                    smallest = s[0].min(s[3]).min(s[0] * s[2] - s[1] * s[1]).min(smallest);
                }
            }
        }
        ([stored, lost], smallest)
    }

    /// Checks that the work of the force equals stored plus dissipated energy to 10⁻⁴. The load is
    /// the paper's first pull of 3.6 radii and the way back. The trapezoidal rule sums the
    /// dissipation, with an error of about 10⁻⁴. Conformations must stay positive definite.
    #[test]
    #[ignore = "thorough"]
    fn work_is_stored_or_lost() {
        let fineness = Discretisation { order: 4, n_angles: 4, ..Discretisation::default() };
        let mesh = FieldMesh::new(&concentric(10.0 / 0.275, fineness), fineness.order, None).expect("a mesh");
        let elements = BaseLaw::Lethersich.elements(&[3.527, 1.402, 47.370].map(Dual::constant));
        let law = FiniteLaw::new(&elements, 0.0).expect("no springpot");
        let mut walker = Walker::new(&mesh, &law, stiffness(&mesh).expect("a solution"));
        let (mut work, mut lost, mut now_s) = (0.0, 0.0, 0.0);
        for force_pa in [60.0, -60.0] {
            walker.past.clear();
            let (mut since_s, mut before) = (0.0, None);
            while since_s < 2.0_f64 {
                let step_s: f64 = if since_s == 0.0 { 1e-3 } else { (0.02 * since_s).min(2.0 - since_s) };
                let from = walker.x[BODY];
                let rates_per_s = walker.step(now_s, step_s, &|_| force_pa).expect("a balance");
                work += force_pa * (walker.x[BODY] - from);
                let ([_, power], smallest) = energy(&walker, &rates_per_s);
                assert!(smallest > 0.0, "{smallest}");
                lost += 0.5 * step_s * (power + before.unwrap_or(power));
                before = Some(power);
                (since_s, now_s) = (since_s + step_s, now_s + step_s);
            }
            let ([stored, _], _) = energy(&walker, &walker.x);
            println!("{force_pa} Pa, {:.2} radii: work {work:.4}, stored {stored:.4}, lost {lost:.4}", walker.x[BODY]);
            assert!((stored + lost - work).abs() < 1e-4 * work, "work {work}, stored {stored}, lost {lost}");
        }
    }
}
