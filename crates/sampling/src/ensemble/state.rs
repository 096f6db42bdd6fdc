//! Complete state of a sampling run, and its conversion to and from the bytes of a checkpoint.

use super::draws::DrawRecord;
use super::moves::Independence;
use super::options::{Phase, SamplerOptions};
use super::walkers::{Ensemble, EnsembleState};
use crate::checkpoint;
use crate::optimum::Modes;
use base::Result;
use serde::{Deserialize, Serialize};

/// Phase, modes, jumps and counts of a run, which change only at convergence checks.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct AdaptationState {
    pub phase: Phase,
    /// Step at which the burn-in ended, or at which the present burn-in round began.
    pub base_step: u64,
    /// Step of the next convergence check.
    pub target_step: u64,
    pub modes: Modes,
    /// Approximation of the posterior from which jumps are drawn, and the fraction of half-steps that jump; `None` without jumps.
    pub jumps: Option<(Independence, f64)>,
    pub walkers_reseeded: u64,
    /// Number of evaluations of the density that are not part of a step.
    pub extra_evaluations: u64,
    /// Latest estimate of the autocorrelation time, in steps, from draws that were kept often enough to resolve it.
    pub autocorrelation_time: Option<f64>,
    /// `true` if the step limit allows no further burn-in although some walkers have not joined the others.
    pub forced: bool,
}

/// Ensemble of walkers, with the draws that it has kept.
#[derive(Debug, Clone)]
pub(super) struct EnsembleRecord {
    pub ensemble: Ensemble,
    pub record: DrawRecord,
}

/// Integers of an [`EnsembleRecord`] in a checkpoint. The record's floating-point numbers follow in binary form.
#[derive(Serialize, Deserialize)]
struct LaneHeader {
    n_steps: u64,
    n_stored: usize,
    base_step: u64,
    store_every: u64,
    accepted: Vec<u64>,
    stream_positions: Vec<u64>,
}

#[derive(Serialize, Deserialize)]
struct Header {
    course: AdaptationState,
    lanes: Vec<LaneHeader>,
}

/// Returns a text that describes all inputs which determine the result of a run. A checkpoint stores the hash of this text.
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

/// Converts the state of a run to the bytes of a checkpoint.
pub(super) fn to_bytes(problem: &str, course: &AdaptationState, lanes: &[EnsembleRecord]) -> Result<Vec<u8>> {
    let states: Vec<EnsembleState> = lanes.iter().map(|lane| lane.ensemble.state()).collect();
    let lane_header = |(lane, state): (&EnsembleRecord, &EnsembleState)| LaneHeader {
        n_steps: state.n_steps,
        n_stored: lane.record.n_stored,
        base_step: lane.record.base_step,
        store_every: lane.record.store_every,
        accepted: state.accepted.clone(),
        stream_positions: state.stream_positions.clone(),
    };
    let header = Header { course: course.clone(), lanes: lanes.iter().zip(&states).map(lane_header).collect() };
    let header = serde_json::to_string(&header).map_err(|error| {
        base::Error::numerical(format!("the sampler's state cannot be written: {error}"), "report this fault")
    })?;
    let mut numbers: Vec<&[f64]> = Vec::new();
    for (lane, state) in lanes.iter().zip(&states) {
        numbers.extend([&state.positions[..], &state.log_density, &lane.record.positions, &lane.record.log_density]);
    }
    Ok(checkpoint::pack(problem, &header, &numbers))
}

/// Converts the bytes of a checkpoint to the state of a run.
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
