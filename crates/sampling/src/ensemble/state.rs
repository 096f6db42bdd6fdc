//! The complete state of a run, and its serialised form.

use super::draws::DrawRecord;
use super::moves::Independence;
use super::options::{Phase, SamplerOptions};
use super::walkers::{Ensemble, EnsembleState, JumpCount};
use crate::checkpoint;
use crate::optimum::Modes;
use base::Result;
use serde::{Deserialize, Serialize};

/// Results of a run's decisions so far. They change only at judgements.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct AdaptationState {
    pub phase: Phase,
    /// Step of the last freeze, or of the start of the last burn-in round.
    pub base_step: u64,
    /// Step of the next judgement.
    pub target_step: u64,
    pub modes: Modes,
    /// Proposal for jumps, and the fraction of half-steps that jump.
    pub jumps: Option<(Independence, f64)>,
    pub walkers_reseeded: u64,
    pub n_freezes: u64,
    /// Evaluations of the density outside of steps.
    pub extra_evaluations: u64,
    /// Latest estimate of the autocorrelation time, in steps, from draws kept often enough to resolve it.
    pub autocorrelation_time: Option<f64>,
    /// True if the step limit forced the freeze while walkers were still left behind.
    pub forced: bool,
}

/// An ensemble with its draws.
#[derive(Debug, Clone)]
pub(super) struct EnsembleRecord {
    pub ensemble: Ensemble,
    pub record: DrawRecord,
}

/// Integers of a lane. Its floating-point numbers follow in binary form.
#[derive(Serialize, Deserialize)]
struct LaneHeader {
    n_steps: u64,
    n_stored: usize,
    base_step: u64,
    store_every: u64,
    accepted: Vec<u64>,
    stream_positions: Vec<u64>,
    jumps: JumpCount,
}

#[derive(Serialize, Deserialize)]
struct Header {
    course: AdaptationState,
    lanes: Vec<LaneHeader>,
}

/// Text of all inputs that determine the result of a run.
pub(super) fn problem(options: &SamplerOptions, dimension: usize, starts: &[Vec<f64>], fingerprint: &str) -> String {
    let SamplerOptions {
        n_walkers, n_ensembles, max_steps, seed, jump_fraction, store_every, max_stored_steps, ..
    } = options;
    let (demands, stop) = (options.convergence, options.stop_when_converged);
    let starts: Vec<Vec<u64>> = starts.iter().map(|start| start.iter().map(|x| x.to_bits()).collect()).collect();
    format!(
        "{n_walkers} {n_ensembles} {max_steps} {seed} {jump_fraction} {store_every:?} {max_stored_steps} {demands:?} {stop} {dimension} {} \
         {starts:x?} {fingerprint}",
        options.kernel.name()
    )
}

/// Serialises a state.
pub(super) fn to_bytes(problem: &str, course: &AdaptationState, lanes: &[EnsembleRecord]) -> Result<Vec<u8>> {
    let states: Vec<EnsembleState> = lanes.iter().map(|lane| lane.ensemble.state()).collect();
    let lane_header = |(lane, state): (&EnsembleRecord, &EnsembleState)| LaneHeader {
        n_steps: state.n_steps,
        n_stored: lane.record.n_stored,
        base_step: lane.record.base_step,
        store_every: lane.record.store_every,
        accepted: state.accepted.clone(),
        stream_positions: state.stream_positions.clone(),
        jumps: state.jumps,
    };
    let header = Header { course: course.clone(), lanes: lanes.iter().zip(&states).map(lane_header).collect() };
    let header = serde_json::to_string(&header).map_err(|error| {
        base::Error::numerical(format!("the sampler's state cannot be written: {error}"), "report this")
    })?;
    let mut numbers: Vec<&[f64]> = Vec::new();
    for (lane, state) in lanes.iter().zip(&states) {
        numbers.extend([&state.positions[..], &state.log_density, &lane.record.positions, &lane.record.log_density]);
    }
    Ok(checkpoint::pack(problem, &header, &numbers))
}

/// Reads a state from bytes.
///
/// # Errors
/// [`base::Error::Input`] if the bytes are damaged or belong to another problem.
pub(super) fn from_bytes(
    problem: &str,
    options: &SamplerOptions,
    dimension: usize,
    bytes: &[u8],
) -> Result<(AdaptationState, Vec<EnsembleRecord>)> {
    let inconsistent = || checkpoint::refuse("the checkpoint is inconsistent", "delete it and start the run again");
    let (header, numbers) = checkpoint::unpack(problem, bytes)?;
    let header: Header = serde_json::from_str(&header).map_err(|_| inconsistent())?;
    let mut rest = &numbers[..];
    let mut take = |n: usize| -> Result<Vec<f64>> {
        let (part, after) = rest.split_at_checked(n).ok_or_else(inconsistent)?;
        rest = after;
        Ok(part.to_vec())
    };
    let w = options.n_walkers;
    if header.lanes.len() != options.n_ensembles {
        return Err(inconsistent());
    }
    let mut lanes = Vec::with_capacity(header.lanes.len());
    for (number, lane) in header.lanes.into_iter().enumerate() {
        if lane.accepted.len() != w || lane.stream_positions.len() != w + 1 || lane.store_every == 0 {
            return Err(inconsistent());
        }
        let state = EnsembleState {
            positions: take(dimension * w)?,
            log_density: take(w)?,
            accepted: lane.accepted,
            stream_positions: lane.stream_positions,
            jumps: lane.jumps,
            n_steps: lane.n_steps,
        };
        let record = DrawRecord {
            positions: take(lane.n_stored.saturating_mul(dimension * w))?,
            log_density: take(lane.n_stored.saturating_mul(w))?,
            n_stored: lane.n_stored,
            base_step: lane.base_step,
            store_every: lane.store_every,
        };
        lanes.push(EnsembleRecord { ensemble: Ensemble::restored(options.seed, number, dimension, &state), record });
    }
    Ok((header.course, lanes))
}
