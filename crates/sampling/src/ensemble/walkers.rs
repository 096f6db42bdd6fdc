//! Ensemble of walkers, and the split-ensemble step that moves them.

use super::moves::{HalfStep, Independence, Move, WalkerPoints};
use super::random::RandomStream;
use crate::{LogDensity, check_log_densities};
use base::Result;
use base::elementary;

/// Moves of a run: a local move that uses only the ensemble, and jumps to draws from a fixed approximation of the posterior.
#[derive(Clone, Copy)]
pub struct Kernel<'a> {
    /// Move that proposes positions for one half of the walkers from the positions of the other half.
    pub local: &'a dyn Move,
    /// Approximation of the posterior from which jumps are drawn, and the fraction of half-steps that jump. `None` disables jumps.
    pub jumps: Option<(&'a Independence, f64)>,
}

/// Ensemble of walkers in two halves. Each half takes its proposals from the positions of the other half, all in one batch.
///
/// With h = `n_walkers / 2` walkers per half, walker w has the index w mod h in the half w / h. The struct holds all data for the next step. Its
/// alignment puts ensembles on different threads into separate cache lines.
#[derive(Debug, Clone)]
#[repr(align(128))]
pub struct Ensemble {
    dimension: usize,
    halves: [Half; 2],
    shared: RandomStream,
    proposal: WalkerProposal,
    n_steps: u64,
}

#[derive(Debug, Clone)]
struct Half {
    /// Positions of the walkers. Coordinate d of walker i of the half is at `positions[d * h + i]`, where h is the number of walkers in the half.
    positions: Vec<f64>,
    log_density: Vec<f64>,
    accepted: Vec<u64>,
    streams: Vec<RandomStream>,
}

/// Work space for the proposals of one half of the walkers.
#[derive(Debug, Clone)]
struct WalkerProposal {
    positions: Vec<f64>,
    log_density: Vec<f64>,
    log_factors: Vec<f64>,
    /// Log density that each proposal must exceed to be accepted.
    floors: Vec<f64>,
}

/// Checkpoint data of an ensemble. The walkers are in the order of their numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct EnsembleState {
    /// Positions of all walkers. Coordinate d of walker w is at `positions[d * n_walkers + w]`.
    pub positions: Vec<f64>,
    /// Log density at each walker's position.
    pub log_density: Vec<f64>,
    /// Number of accepted proposals of each walker since the end of the burn-in.
    pub accepted: Vec<u64>,
    /// Number of random words read from each walker's stream. The last entry is for the stream that all walkers share.
    pub stream_positions: Vec<u64>,
    /// Number of steps that the ensemble has made.
    pub n_steps: u64,
}

impl Ensemble {
    /// Makes the ensemble with index `number` in a run from its walkers' positions (layout of [`EnsembleState::positions`]) and their log densities.
    ///
    /// Random streams are numbered walker by walker over all ensembles. The shared streams of the ensembles have numbers from 2⁶³.
    pub fn new(seed: u64, number: usize, dimension: usize, positions: &[f64], log_density: &[f64]) -> Self {
        let n_walkers = log_density.len();
        let h = n_walkers / 2;
        let half = |first: usize| Half {
            positions: (0..dimension)
                .flat_map(|d| &positions[d * n_walkers + first..d * n_walkers + first + h])
                .copied()
                .collect(),
            log_density: log_density[first..first + h].to_vec(),
            accepted: vec![0; h],
            streams: (first..first + h).map(|w| RandomStream::new(seed, (number * n_walkers + w) as u64)).collect(),
        };
        let proposal = WalkerProposal {
            positions: vec![0.0; dimension * h],
            log_density: vec![0.0; h],
            log_factors: vec![0.0; h],
            floors: vec![0.0; h],
        };
        let shared = RandomStream::new(seed, (1 << 63) | number as u64);
        Self { dimension, halves: [half(0), half(h)], shared, proposal, n_steps: 0 }
    }

    /// Makes one step: proposes a new position for every walker and accepts or rejects it.
    ///
    /// # Errors
    /// [`base::Error::Numerical`] if a log density is NaN or +∞.
    pub fn step(&mut self, density: &dyn LogDensity, kernel: &Kernel) -> Result<()> {
        for moving in 0..2 {
            self.half_step(moving, density, kernel)?;
        }
        self.n_steps += 1;
        Ok(())
    }

    fn half_step(&mut self, moving: usize, density: &dyn LogDensity, kernel: &Kernel) -> Result<()> {
        let dimension = self.dimension;
        let [first, second] = &mut self.halves;
        let (half, other) = if moving == 0 { (first, second) } else { (second, first) };
        let n = half.log_density.len();
        let proposal = &mut self.proposal;
        let jump = kernel.jumps.filter(|(_, fraction)| self.shared.unit() < *fraction).map(|(jump, _)| jump);
        let chosen: &dyn Move = jump.map_or(kernel.local, |jump| jump);
        chosen.propose(HalfStep {
            moving: WalkerPoints { coordinates: &half.positions, n, dimension },
            complement: WalkerPoints { coordinates: &other.positions, n, dimension },
            shared: &mut self.shared,
            random_streams: &mut half.streams,
            proposals: &mut proposal.positions,
            log_factors: &mut proposal.log_factors,
        });
        half.draw_floors(proposal);
        density.log_density_above(&proposal.positions, &proposal.floors, &mut proposal.log_density);
        check_log_densities(dimension, &proposal.positions, &proposal.log_density)?;
        half.accept(proposal, dimension);
        Ok(())
    }

    /// Number of walkers.
    pub fn n_walkers(&self) -> usize {
        2 * self.halves[0].log_density.len()
    }

    /// Number of steps that the ensemble has made.
    pub fn n_steps(&self) -> u64 {
        self.n_steps
    }

    /// Number of accepted proposals of each walker since the last call of [`Ensemble::reset_acceptance`].
    pub fn accepted(&self) -> impl Iterator<Item = u64> {
        self.halves.iter().flat_map(|half| half.accepted.iter().copied())
    }

    /// Sets the counts of accepted proposals to zero.
    pub fn reset_acceptance(&mut self) {
        self.halves.iter_mut().for_each(|half| half.accepted.fill(0));
    }

    /// Appends the positions (layout of [`EnsembleState::positions`]) and log densities of all walkers to the two vectors.
    pub fn record(&self, positions: &mut Vec<f64>, log_density: &mut Vec<f64>) {
        let h = self.halves[0].log_density.len();
        for d in 0..self.dimension {
            self.halves.iter().for_each(|half| positions.extend_from_slice(&half.positions[d * h..(d + 1) * h]));
        }
        self.halves.iter().for_each(|half| log_density.extend_from_slice(&half.log_density));
    }

    /// Position of a walker, one value per coordinate.
    pub fn position(&self, walker: usize) -> Vec<f64> {
        let h = self.halves[0].log_density.len();
        let (half, i) = (&self.halves[walker / h], walker % h);
        (0..self.dimension).map(|d| half.positions[d * h + i]).collect()
    }

    /// Log density at a walker's position.
    pub fn log_density(&self, walker: usize) -> f64 {
        let h = self.halves[0].log_density.len();
        self.halves[walker / h].log_density[walker % h]
    }

    /// Moves a walker to another position with a known log density. Use this function only during the burn-in, because it changes the sampled
    /// distribution.
    pub fn set_walker(&mut self, walker: usize, position: &[f64], log_density: f64) {
        let h = self.halves[0].log_density.len();
        let (half, i) = (&mut self.halves[walker / h], walker % h);
        for (d, &x) in position.iter().enumerate() {
            half.positions[d * h + i] = x;
        }
        half.log_density[i] = log_density;
    }

    /// Random stream of a walker, for draws between steps.
    pub fn stream(&mut self, walker: usize) -> &mut RandomStream {
        let h = self.halves[0].log_density.len();
        &mut self.halves[walker / h].streams[walker % h]
    }

    /// Returns the checkpoint data of the ensemble.
    pub fn state(&self) -> EnsembleState {
        let (mut positions, mut log_density) = (Vec::new(), Vec::new());
        self.record(&mut positions, &mut log_density);
        let streams = self.halves.iter().flat_map(|half| &half.streams).chain([&self.shared]);
        EnsembleState {
            positions,
            log_density,
            accepted: self.accepted().collect(),
            stream_positions: streams.map(RandomStream::position).collect(),
            n_steps: self.n_steps,
        }
    }

    /// Restores an ensemble from its checkpoint data, equal to the last bit. The lengths of the vectors in `state` must agree with each other.
    pub fn restored(seed: u64, number: usize, dimension: usize, state: &EnsembleState) -> Self {
        let mut ensemble = Self::new(seed, number, dimension, &state.positions, &state.log_density);
        let h = ensemble.halves[0].log_density.len();
        for (k, half) in ensemble.halves.iter_mut().enumerate() {
            half.accepted.copy_from_slice(&state.accepted[k * h..(k + 1) * h]);
            for (stream, &position) in half.streams.iter_mut().zip(&state.stream_positions[k * h..]) {
                stream.seek(position);
            }
        }
        ensemble.shared.seek(state.stream_positions[2 * h]);
        ensemble.n_steps = state.n_steps;
        ensemble
    }
}

impl Half {
    /// Draws the log density that each proposal must exceed by the Metropolis–Hastings rule. Reads one random word per walker.
    fn draw_floors(&mut self, proposal: &mut WalkerProposal) {
        proposal.floors.iter_mut().zip(&mut self.streams).for_each(|(u, stream)| *u = stream.unit());
        elementary::ln_all(&mut proposal.floors);
        for (floor, (own, factor)) in proposal.floors.iter_mut().zip(self.log_density.iter().zip(&proposal.log_factors))
        {
            *floor += own - factor;
        }
    }

    /// Accepts or rejects the proposal of each walker.
    fn accept(&mut self, proposal: &WalkerProposal, dimension: usize) {
        let n = self.log_density.len();
        for i in 0..n {
            // The floor can be NaN because of a factor 0·∞. The comparison is then false, and the walker stays.
            let accept = proposal.log_density[i] > proposal.floors[i];
            self.accepted[i] += u64::from(accept);
            if accept {
                self.log_density[i] = proposal.log_density[i];
                for d in 0..dimension {
                    self.positions[d * n + i] = proposal.positions[d * n + i];
                }
            }
        }
    }
}
