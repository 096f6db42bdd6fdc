//! Derivatives of the position by the function's parameters, computed during a run. Each time step solves its linearised
//! equations once more for every parameter.

use super::super::collocation::{END, N_NODES};
use super::super::numbers::{Lanes, N_LANES, Real};
use super::balance::{Imbalance, Nodes, no_balance, solved};
use super::modes::{Modes, Step};
use super::{Carried, Source, StateLawRun};
use base::error::Result;
use base::number::Complex;
use laws::stages::{Operation, State};

/// Derivatives of a run's state, and of its excess over the linear law's position, by all parameters of the function. They are in blocks of
/// eight parameters.
pub struct Slopes {
    n_parameters: usize,
    blocks: Vec<SlopeBlock>,
    /// Derivatives of the function by the parameters, first by node and then by parameter.
    by_parameters: Vec<f64>,
}

/// Derivatives, by the parameters of one block, of the run's state and of its excess over the linear law's position at the rows.
struct SlopeBlock {
    by_feedback: (Vec<Lanes>, Vec<Complex<Lanes>>),
    feedback_n: Lanes,
    position_m: Lanes,
    path_m: Lanes,
    largest_m: Lanes,
    velocity: Lanes,
    excess_m: Vec<Lanes>,
}

const ZERO: Lanes = Lanes([0.0; N_LANES]);

impl Slopes {
    pub fn new<T: Real>(n_parameters: usize, modes: &Modes<T>, n_rows: usize) -> Self {
        let block = || SlopeBlock {
            by_feedback: (vec![ZERO; modes.n_real], vec![Complex { re: ZERO, im: ZERO }; modes.n_oscillating]),
            feedback_n: ZERO,
            position_m: ZERO,
            path_m: ZERO,
            largest_m: ZERO,
            velocity: ZERO,
            excess_m: vec![ZERO; n_rows],
        };
        let blocks = (0..n_parameters.div_ceil(N_LANES)).map(|_| block()).collect();
        Self { n_parameters, blocks, by_parameters: Vec::new() }
    }

    /// Derivatives of the excess over the linear law's position, indexed by parameter and then by row.
    pub fn excess_m(&self) -> Vec<Vec<f64>> {
        let of = |k: usize| self.blocks[k / N_LANES].excess_m.iter().map(|row| row.0[k % N_LANES]).collect();
        (0..self.n_parameters).map(of).collect()
    }

    /// Sets the derivatives of the function by its parameters at the given states.
    fn set_by_parameters<T: Real>(&mut self, run: &StateLawRun<'_, T>, states: &[f64]) {
        self.by_parameters.resize(states.len() * self.n_parameters, 0.0);
        if self.n_parameters > 0 {
            for (state, slopes) in states.iter().zip(self.by_parameters.chunks_mut(self.n_parameters)) {
                run.law.function.0.by_parameters(*state, &run.constants, slopes);
            }
        }
    }
}

/// Returns the derivatives of the function at one node by the parameters of one block.
fn of_node(by_parameters: &[f64], n_parameters: usize, block: usize, node: usize) -> Lanes {
    let of_block = by_parameters[node * n_parameters..][..n_parameters].chunks(N_LANES).nth(block).unwrap_or(&[]);
    Lanes(std::array::from_fn(|lane| of_block.get(lane).copied().unwrap_or(0.0)))
}

impl<T: Real> StateLawRun<'_, T> {
    /// Stores the derivatives of the excess over the linear law's position at a row.
    pub fn note_slopes(&self, slopes: &mut Slopes, now: &Carried<T>, row: usize) {
        let is_of_position = matches!(self.source, Source::Position);
        if is_of_position {
            let state = self.state_now(now, now.level_n + now.deficit_n).value();
            slopes.set_by_parameters(self, &[state]);
        }
        for (place, block) in slopes.blocks.iter_mut().enumerate() {
            block.excess_m[row] = if is_of_position {
                let factor = if self.law.operation == Operation::Add { 1.0 } else { now.position_m.value() };
                of_node(&slopes.by_parameters, slopes.n_parameters, place, 0) * factor
            } else {
                let (real, oscillating) = &block.by_feedback;
                let sum = real.iter().fold(block.feedback_n * self.modes.instantaneous[1].value(), |sum, y| sum + *y);
                oscillating.iter().fold(sum, |sum, y| sum + y.re) * now.growth.value()
            };
        }
    }

    /// Advances the derivatives through a step, or through a jump (`step` is `None`), after the pseudo-stress and the positions are known.
    /// `now` is the state at the step's start.
    pub fn follow<const N: usize>(
        &self,
        slopes: &mut Slopes,
        (nodes, now): (&Nodes<T, N>, &Carried<T>),
        (feedback, position_m): (&[T; N], &[T; N]),
        step: Option<&Step<T>>,
    ) -> Result<()> {
        if matches!(self.source, Source::Position) {
            return Ok(());
        }
        let length_s = step.map(|step| step.length_s);
        let at = self.imbalance(nodes, now, feedback, length_s);
        slopes.set_by_parameters(self, &at.states);
        let length_s = length_s.map_or(1.0, |length_s| length_s.value());
        let growth: [f64; N] = nodes.growth.map(|growth| growth.value());
        for (place, block) in slopes.blocks.iter_mut().enumerate() {
            let known: [Lanes; N] = std::array::from_fn(|i| block.known(step, i));
            let carried = block.carried(self, &at, step.map(|_| length_s));
            let right = std::array::from_fn(|i| {
                let by_function = of_node(&slopes.by_parameters, slopes.n_parameters, place, i);
                let state = (0..N).fold(carried[i], |sum, k| sum + known[k] * (at.by_position[i][k] * growth[k]));
                (by_function + state * at.by_state[i]) * at.by_value[i] + known[i] * at.by_strain[i]
            });
            let feedback = solved(at.matrix, right).ok_or_else(|| no_balance(now.now_s.value()))?;
            let moved: [Lanes; N] = std::array::from_fn(|i| {
                let answered = (0..N).fold(known[i], |sum, j| sum + feedback[j] * nodes.by_feedback[i][j].value());
                answered * growth[i]
            });
            if step.is_some() {
                let slope = |begin: Lanes| {
                    let zip = moved.iter().zip(&self.slopes[END][1..]);
                    zip.fold(begin * self.slopes[END][0], |sum, (x, slope)| sum + *x * *slope)
                };
                block.velocity = slope(block.position_m) * length_s.recip();
            }
            block.advance(step, &feedback);
            let (mut before_m, mut largest_m) = (now.position_m.value(), now.largest_m.value());
            for (x, slope) in position_m.iter().map(|x| x.value()).zip(moved) {
                block.path_m += (slope - block.position_m) * if x < before_m { -1.0 } else { 1.0 };
                if x.abs() > largest_m {
                    (largest_m, block.largest_m) = (x.abs(), slope * if x < 0.0 { -1.0 } else { 1.0 });
                }
                (before_m, block.position_m) = (x, slope);
            }
        }
        Ok(())
    }
}

impl SlopeBlock {
    /// Returns the derivatives of the sum of the modes' contributions at a node, without the pseudo-stress in this step.
    fn known<T: Real>(&self, step: Option<&Step<T>>, node: usize) -> Lanes {
        let (real, oscillating) = &self.by_feedback;
        let mut sum = ZERO;
        for (k, y) in real.iter().enumerate() {
            sum += *y * step.map_or(1.0, |step| step.real[k].node_decay[node].value());
        }
        for (k, y) in oscillating.iter().enumerate() {
            sum += match step.map(|step| step.oscillating[k].node_decay[node]) {
                Some(decay) => y.re * decay.re.value() - y.im * decay.im.value(),
                None => y.re,
            };
        }
        sum
    }

    /// Returns the derivatives of the states at the nodes, with the positions at the nodes held constant.
    fn carried<T: Real, const N: usize>(
        &self,
        run: &StateLawRun<'_, T>,
        at: &Imbalance<T, N>,
        length_s: Option<f64>,
    ) -> [Lanes; N] {
        std::array::from_fn(|i| match run.law.state {
            State::Path => self.path_m - self.position_m * at.by_position[0][0],
            State::LargestExcursion if at.by_position[i] == [0.0; N] => self.largest_m,
            State::Velocity => match length_s {
                Some(length_s) if N == N_NODES => self.position_m * (run.slopes[i][0] / length_s),
                _ => self.velocity,
            },
            _ => ZERO,
        })
    }

    /// Advances the derivatives of the modes and of the pseudo-stress to the step's end.
    fn advance<T: Real, const N: usize>(&mut self, step: Option<&Step<T>>, feedback: &[Lanes; N]) {
        self.feedback_n = feedback[N - 1];
        let Some(step) = step else { return };
        for (y, step) in self.by_feedback.0.iter_mut().zip(&step.real) {
            let weighted = |sum: Lanes, k: usize| sum + feedback[k] * step.weights[k].value();
            *y = (0..N).fold(*y * step.whole.decay.value(), weighted);
        }
        for (y, step) in self.by_feedback.1.iter_mut().zip(&step.oscillating) {
            let constant = |z: Complex<T>| Complex::<Lanes>::constant(z.re.value(), z.im.value());
            let weighted = |sum: Complex<Lanes>, k: usize| sum + constant(step.weights[k]).times(feedback[k]);
            *y = (0..N).fold(constant(step.whole.decay) * *y, weighted);
        }
    }
}
