//! Groups of the file `posterior.nc` that have one value per row of the record: data, log-likelihood of each position, posterior predictions and prior
//! predictions.
//!
//! The predictions come from the reduced model, for a few hundred draws spread evenly over all chains. Only some rows are predicted for long records, to
//! keep the files small.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use figures::labels::parameter_label;
use figures::netcdf::{DrawsByRow, PriorDraws, RecordGroups, RowColumn, arrangement};
use models::model::{Forward, SurrogateForward};
use posterior::likelihood::ReducedPosterior;
use posterior::noise::{Conditional, NoiseLikelihood};
use posterior::prepared::PreparedModel;
use posterior::problem::Problem;
use sampling::ensemble::Draws;

/// Largest total number of predicted draws, over all chains.
const MOST_DRAWS: usize = 500;
/// Smallest total number of predicted draws, which applies to long records. It is also the number of prior predictions by a nonlinear law, whose trajectories far
/// from the posterior take milliseconds each.
const FEWEST_DRAWS: usize = 100;
/// Largest number of values in one variable (4 MB). For longer records, only every k-th row is predicted.
const MOST_VALUES: usize = 500_000;
/// Number of the first random stream for the noise that is added to predictions of posterior draws. Each draw has its own stream.
const POSTERIOR_STREAM: u64 = 1 << 50;
/// Number of the first random stream for the prior draws. Each draw has its own stream.
const PRIOR_STREAM: u64 = 1 << 51;
/// Largest number of attempts to draw prior parameters for which the model has a prediction.
const MOST_TRIES: usize = 100;
/// ln 10⁶, the logarithm of the number of µm per m. Subtracting it converts a log-density per metre to one per µm.
const LN_UM_PER_M: f64 = 13.815_510_557_964_274;

/// Name of the variable that holds positions, in every group.
const POSITION: &str = "position_um";

/// Makes all groups of `posterior.nc` that have one value per row of the record. `seed` is the seed of the simulated noise and of the prior draws.
pub fn record_groups(model: &PreparedModel, draws: &Draws, seed: u64) -> RecordGroups<'static> {
    let problem = &model.problem;
    let record = &problem.experiment.record;
    let observed_rows: Vec<usize> = (0..record.n_rows()).filter(|row| record.position_m[*row].is_some()).collect();
    let is_fitted = |cycle: &u32| problem.experiment.calibration_cycles.contains(cycle);
    let column = |name, unit, values| RowColumn { name, unit, values };
    let constant = vec![
        column("time_s", "s", record.time_s.clone()),
        column("force_un", "µN", record.force_n.iter().map(|force| 1e6 * force).collect()),
        column("cycle", "1", record.cycle.iter().map(|cycle| f64::from(*cycle)).collect()),
        column("fitted", "1", record.cycle.iter().map(|cycle| f64::from(u8::from(is_fitted(cycle)))).collect()),
    ];
    let measured_um = record.position_m.iter().flatten().map(|x| 1e6 * x).collect();
    let mut groups = RecordGroups {
        constant,
        observed_rows: observed_rows.iter().map(|row| *row as i64).collect(),
        observed: vec![column(POSITION, "µm", measured_um)],
        prior: None,
        drawn: Vec::new(),
    };
    if !observed_rows.is_empty() && !draws.is_empty() {
        let posterior = model.posterior();
        let predictor = Predictor::new(model, &posterior, &observed_rows, draws.n_ensembles, seed);
        predictor.add_posterior(draws, &mut groups);
        predictor.add_prior(&model.forward(), &mut groups);
    }
    groups
}

/// Prediction for one draw: the log-density of each fitted position, and the position with noise at each predicted row.
type DrawPrediction = (Vec<f64>, Vec<f64>);

/// Computes predictions of the chosen rows for the chosen draws.
struct Predictor<'a> {
    problem: &'a Problem,
    posterior: &'a ReducedPosterior<'a>,
    /// Model for draws of the posterior, which are near each other.
    local_forward: SurrogateForward<'a>,
    likelihood: NoiseLikelihood,
    /// Predicted rows: every `stride`-th row that has a position.
    rows: Vec<usize>,
    stride: usize,
    /// Predicted rows that were also fitted: index among the fitted rows of the likelihood, and index in the record.
    fitted: Vec<(usize, usize)>,
    n_chains: usize,
    /// Number of predicted draws per chain.
    n_draws: usize,
    seed: u64,
}

impl<'a> Predictor<'a> {
    fn new(
        model: &'a PreparedModel,
        posterior: &'a ReducedPosterior<'a>,
        observed_rows: &[usize],
        n_chains: usize,
        seed: u64,
    ) -> Self {
        let problem = &model.problem;
        let local_forward = model.local_forward(problem.experiment.record.n_rows());
        let stride = (observed_rows.len() * FEWEST_DRAWS).div_ceil(MOST_VALUES).max(1);
        let rows: Vec<usize> = observed_rows.iter().copied().step_by(stride).collect();
        let of_all = (MOST_VALUES / rows.len()).clamp(FEWEST_DRAWS, MOST_DRAWS);
        let likelihood = problem.noise_likelihood(&problem.experiment.calibration_cycles);
        let is_chosen = |(_, row): &(usize, usize)| rows.binary_search(row).is_ok();
        let fitted = likelihood.observed_rows().enumerate().filter(is_chosen).collect();
        let n_draws = of_all.div_ceil(n_chains);
        Self { problem, posterior, local_forward, likelihood, rows, stride, fitted, n_chains, n_draws, seed }
    }

    fn random(&self, stream: u64) -> ChaCha8Rng {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        rng.set_stream(stream);
        rng
    }

    /// Returns the positions (m) at all rows of the record and the noise parameters; `None` if the model has no prediction. `natural` holds the parameters in
    /// natural units.
    fn prediction(&self, forward: &SurrogateForward, natural: &[f64]) -> Option<(Vec<f64>, Vec<f64>)> {
        let (model, noise) = natural.split_at(self.problem.model.parameters().len());
        let trajectory_m = forward.trajectory_m(model).ok()?;
        trajectory_m.iter().all(|x| x.is_finite()).then(|| (trajectory_m, noise.to_vec()))
    }

    /// Returns the positions (µm) of the predicted rows with simulated noise added.
    fn with_noise_um(&self, trajectory_m: &[f64], noise: &[f64], rng: &mut ChaCha8Rng) -> Vec<f64> {
        let record = &self.problem.experiment.record;
        let time_s: Vec<f64> = self.rows.iter().map(|row| record.time_s[*row]).collect();
        let recordings = self.problem.recordings();
        let cycle: Vec<u32> = self.rows.iter().map(|row| recordings[*row]).collect();
        let position_m: Vec<f64> = self.rows.iter().map(|row| trajectory_m[*row]).collect();
        let noise_m = self.problem.noise.simulate_m(&time_s, &cycle, &position_m, noise, rng);
        position_m.iter().zip(noise_m).map(|(x, e)| 1e6 * (x + e)).collect()
    }

    fn add_posterior(&self, draws: &Draws, groups: &mut RecordGroups) {
        let order = arrangement(draws.n_walkers, draws.n_steps);
        let n_draws = self.n_draws.min(order.len());
        let places: Vec<usize> = (0..n_draws).map(|k| (2 * k + 1) * order.len() / (2 * n_draws)).collect();
        let one = |index: usize| {
            let [walker, step] = order[places[index % n_draws]];
            let natural = self.posterior.natural(&draws.point(index / n_draws, step, walker));
            let (trajectory_m, noise) = self.prediction(&self.local_forward, &natural)?;
            let ln_density = self.likelihood.ln_pointwise(&trajectory_m, &noise);
            let chosen = self.fitted.iter().map(|(place, _)| ln_density[*place] - LN_UM_PER_M).collect::<Vec<f64>>();
            let rng = &mut self.random(POSTERIOR_STREAM + index as u64);
            Some((chosen, self.with_noise_um(&trajectory_m, &noise, rng)))
        };
        let all: Vec<Option<DrawPrediction>> = (0..self.n_chains * n_draws).into_par_iter().map(one).collect();
        // If the model has no prediction for a draw in one chain, the draw with this number is left out of all chains.
        let is_there = |k: &usize| (0..self.n_chains).all(|chain| all[chain * n_draws + k].is_some());
        let kept: Vec<usize> = (0..n_draws).filter(is_there).collect();
        let of = |part: fn(&DrawPrediction) -> &Vec<f64>| -> Vec<f64> {
            let chains = (0..self.n_chains).flat_map(|chain| kept.iter().map(move |k| chain * n_draws + k));
            chains.filter_map(|index| all[index].as_ref()).flat_map(|pair| part(pair).iter().copied()).collect()
        };
        if kept.is_empty() {
            return;
        }
        let selection = self.selection(&format!("{} of {} draws per chain, evenly spread", kept.len(), order.len()));
        let of_group = |group, unit, note, rows, values| DrawsByRow {
            group,
            name: POSITION,
            unit,
            note,
            n_chains: self.n_chains,
            draws: kept.iter().map(|k| places[*k] as i64).collect(),
            rows,
            values,
        };
        let given = match self.likelihood.conditional() {
            Conditional::Nothing => "given the parameters: errors are independent",
            Conditional::AllOthers => {
                "given the parameters and all other fitted positions (exact for correlated normal errors): its inverse is the weight of leave-one-out cross-validation"
            }
            Conditional::AllBefore => {
                "given the parameters and all fitted positions before it (heavy tails with a process or gains): sums of it are leave-future-out scores"
            }
        };
        let note = format!(
            "ln density of each fitted position, in nats for positions in µm, {given}; {selection}; these draws are nearly independent: use az.loo(data, reff=1)"
        );
        let fitted = self.fitted.iter().map(|(_, row)| *row as i64).collect();
        groups.drawn.push(of_group("log_likelihood", "1", note, fitted, of(|pair| &pair.0)));
        let note = format!("positions with noise, by the reduced model; {selection}");
        groups.drawn.push(of_group("posterior_predictive", "µm", note, self.row_labels(), of(|pair| &pair.1)));
    }

    /// Adds predictions of prior draws by `forward`, for laws that are far from each other.
    fn add_prior(&self, forward: &SurrogateForward, groups: &mut RecordGroups) {
        let priors = &self.problem.priors;
        let one = |index: usize| {
            let mut rng = self.random(PRIOR_STREAM + index as u64);
            (0..MOST_TRIES).find_map(|_| {
                let values = priors.draw(&mut rng);
                let natural = self.posterior.natural(&priors.to_unconstrained(&values));
                let (trajectory_m, noise) = self.prediction(forward, &natural)?;
                let position_um = self.with_noise_um(&trajectory_m, &noise, &mut rng);
                position_um.iter().all(|x| x.is_finite()).then_some((values, position_um))
            })
        };
        let most = if self.problem.model.is_nonlinear() { FEWEST_DRAWS } else { usize::MAX };
        let n_draws = most.min(self.n_draws * self.n_chains);
        let all: Vec<(Vec<f64>, Vec<f64>)> = (0..n_draws).into_par_iter().filter_map(one).collect();
        if all.is_empty() {
            return;
        }
        let units: Vec<String> = priors.names().map(|name| parameter_label(name).unit).collect();
        groups.prior = Some(PriorDraws {
            names: priors.names().map(String::from).collect(),
            units,
            columns: (0..priors.priors().len()).map(|d| all.iter().map(|pair| pair.0[d]).collect()).collect(),
            note: "draws at which the model has no prediction are drawn again".into(),
        });
        let selection = self.selection(&format!("{} draws", all.len()));
        groups.drawn.push(DrawsByRow {
            group: "prior_predictive",
            name: POSITION,
            unit: "µm",
            note: format!("positions with noise, by the reduced model; {selection}"),
            n_chains: 1,
            draws: (0..all.len() as i64).collect(),
            rows: self.row_labels(),
            values: all.iter().flat_map(|pair| pair.1.iter().copied()).collect(),
        });
    }

    fn row_labels(&self) -> Vec<i64> {
        self.rows.iter().map(|row| *row as i64).collect()
    }

    /// Describes in words which draws and rows are predicted.
    fn selection(&self, draws: &str) -> String {
        match self.stride {
            1 => format!("{draws}; every row with a position"),
            stride => format!("{draws}; one of every {stride} rows with a position, so that the file stays small"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use posterior::monitor::SilentMonitor;
    use posterior::replica;
    use posterior::study::ModelSpecification;
    use record::Apparatus;
    use sampling::ensemble::RandomStream;

    /// Draws of eight walkers in four ensembles, near the prior medians of the parameters.
    fn draws(problem: &Problem) -> Draws {
        let (n_ensembles, n_steps, n_walkers) = (4, 20, 8);
        let medians: Vec<f64> = problem
            .priors
            .priors()
            .iter()
            .map(|prior| prior.distribution.to_unconstrained(prior.distribution.quantile(0.5)))
            .collect();
        let mut stream = RandomStream::new(3, 3);
        let n = n_ensembles * n_steps;
        let positions =
            (0..n).flat_map(|_| medians.clone()).flat_map(|x| vec![x; n_walkers]).map(|x| x + 0.01 * stream.unit());
        Draws {
            n_ensembles,
            n_steps,
            n_walkers,
            dimension: medians.len(),
            store_every: 1,
            positions: positions.collect(),
            log_density: vec![0.0; n * n_walkers],
        }
    }

    fn groups(noise: &[&str], n_rows: usize) -> (Problem, RecordGroups<'static>) {
        let (mut experiment, _) = replica::embedded().expect("embedded");
        experiment.apparatus = Apparatus::Instrument { compliance_per_m: 549.178, is_stress_strain: false };
        let record = &mut experiment.record;
        if n_rows > record.n_rows() {
            record.time_s = (0..n_rows).map(|row| 1e-3 * row as f64).collect();
            record.force_n = (0..n_rows).map(|row| if row % 1000 < 500 { 4.6e-6 } else { -4.6e-6 }).collect();
            record.cycle = (0..n_rows).map(|row| 1 + (4 * row / n_rows) as u32).collect();
            record.position_m = vec![Some(0.0); n_rows];
        }
        let noise = noise.iter().map(ToString::to_string).collect();
        let specification = ModelSpecification { noise, ..ModelSpecification::default() };
        let problem = Problem::new(experiment, specification, None, &SilentMonitor).expect("sound");
        let model = PreparedModel::unverified(&problem, None, &SilentMonitor).expect("an instrument");
        let groups = record_groups(&model, &draws(&problem), 1);
        (problem, groups)
    }

    fn group<'a>(groups: &'a RecordGroups<'static>, name: &str) -> &'a DrawsByRow<'static> {
        groups.drawn.iter().find(|drawn_rows| drawn_rows.group == name).expect("written")
    }

    /// Each fitted position has a log-likelihood, and each measured position has a prediction. The log-likelihoods add up to the total.
    #[test]
    fn rows_are_those_that_were_fitted_and_measured() {
        let (problem, groups) = groups(&["white"], 0);
        let experiment = &problem.experiment;
        let fitted = problem.positions_of(&experiment.calibration_cycles);
        let ln_likelihood = group(&groups, "log_likelihood");
        let expected: Vec<i64> = (0..fitted.len()).filter(|row| fitted[*row].is_some()).map(|row| row as i64).collect();
        assert_eq!(ln_likelihood.rows, expected);
        assert_eq!(group(&groups, "posterior_predictive").rows, groups.observed_rows);
        assert_eq!(group(&groups, "prior_predictive").rows, groups.observed_rows);
        assert_eq!(groups.constant[0].values.len(), experiment.record.n_rows());
        let n_fitted: f64 = groups.constant[3].values.iter().sum();
        let of_cycle =
            experiment.record.cycle.iter().filter(|row_cycle| experiment.calibration_cycles.contains(row_cycle));
        assert_eq!(n_fitted as usize, of_cycle.count());
        // The first draw of the first chain is compared with the likelihood of all positions.
        let prepared = PreparedModel::unverified(&problem, None, &SilentMonitor).expect("an instrument");
        let posterior = prepared.posterior();
        let [walker, step] = arrangement(8, 20)[ln_likelihood.draws[0] as usize];
        let natural = posterior.natural(&draws(&problem).point(0, step, walker));
        let (model, noise) = natural.split_at(problem.model.parameters().len());
        let trajectory_m = prepared.forward().trajectory_m(model).expect("a model");
        let whole = problem.noise_likelihood(&experiment.calibration_cycles).ln_likelihood(&trajectory_m, noise);
        let n = ln_likelihood.rows.len();
        let sum = ln_likelihood.values[..n].iter().sum::<f64>() + n as f64 * LN_UM_PER_M;
        assert!((sum / whole - 1.0).abs() < 1e-9, "{sum} {whole}");
        assert!(groups.prior.is_some_and(|prior| prior.columns.len() == problem.priors.priors().len()));
    }

    #[test]
    fn notes_say_what_is_given() {
        for (noise, words) in [
            (&["white", "ou"][..], "all other fitted positions"),
            (&["white", "student"], "errors are independent"),
            (&["white", "gain", "student"], "before it"),
        ] {
            let (_, groups) = groups(noise, 0);
            let note = &group(&groups, "log_likelihood").note;
            assert!(note.contains(words) && note.contains("every row"), "{note}");
        }
    }

    /// For a record of 200,000 rows each variable has at most 4 MB, and the note says that rows were left out.
    #[test]
    fn long_records_stay_small() {
        let (_, groups) = groups(&["white"], 200_000);
        for group in &groups.drawn {
            assert!(
                group.values.len() <= MOST_VALUES + 200_000 / 40 && group.values.len() > MOST_VALUES / 8,
                "{}",
                group.group
            );
            assert!(group.note.contains("one of every 40 rows"), "{}", group.note);
        }
    }
}
