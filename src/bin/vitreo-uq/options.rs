//! Arguments of all commands.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use vitreo_uq::base::error::{Error, Place};
use vitreo_uq::posterior::prior::PriorSet;
use vitreo_uq::sampling::SamplerOptions;

use crate::report::PageArguments;

/// What every command takes.
#[derive(Args, Clone)]
pub struct Common {
    /// Experiment (directory with experiment.toml, or the TOML), or study; without it the embedded porcine replica
    #[arg(value_name = "EXPERIMENT|STUDY")]
    pub target: Option<PathBuf>,
    /// Study directory [default: vitreo-uq-out/<specimen id>]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Write the result as one JSON document to a file, or alone to standard output with `-`
    #[arg(long, value_name = "FILE|-")]
    pub json: Option<PathBuf>,
    /// Seed of all random numbers
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true)]
    pub seed: u64,
    /// Threads; 0 for as many as there are cores
    #[arg(long, value_name = "N", default_value_t = 0, allow_negative_numbers = true)]
    pub threads: usize,
    /// No progress on standard error
    #[arg(long)]
    pub quiet: bool,
    /// Replace a study or revision that was made from another input or model
    #[arg(long)]
    pub force: bool,
}

/// What is modelled, and how.
#[derive(Args, Clone)]
pub struct Model {
    /// Base law: lethersich, burgers, two-element, or a TOML file with a [base.network]
    #[arg(long, value_name = "LAW|FILE.toml")]
    pub base: Option<String>,
    /// Take another program's model in place of ours: a server of UM-Bridge, whose parameters the prior names
    #[arg(long, value_name = "http://HOST:PORT", conflicts_with = "base")]
    pub forward: Option<String>,
    /// The server's model [default: `forward`, or the only one]
    #[arg(long, value_name = "NAME", requires = "forward")]
    pub forward_model: Option<String>,
    /// Effects to add, separated by commas: names that `effects` lists, or files that define one
    #[arg(long, value_name = "SLUG|FILE.toml", value_delimiter = ',')]
    pub with: Vec<String>,
    /// Noise terms, separated by commas: white, ou, gain, student
    #[arg(long, value_name = "TERM", value_delimiter = ',')]
    pub noise: Vec<String>,
    #[arg(long, value_name = "NAME|FILE", help = prior_help())]
    pub prior: Option<String>,
    /// Fix a parameter (in `simulate`: give its value), or free one that is held, by NAME=free; may be repeated
    #[arg(long, value_name = "NAME=VALUE")]
    pub set: Vec<String>,
    /// Take the model of this revision of a study [default: the last]
    #[arg(long, value_name = "REV")]
    pub from: Option<String>,
    /// Gmsh 4.1 mesh of the quarter model, instead of the built-in mesh
    #[arg(long, value_name = "FILE.msh")]
    pub mesh: Option<PathBuf>,
    /// Length unit of that mesh in m
    #[arg(long, value_name = "METRES", default_value_t = 1e-3)]
    pub mesh_unit: f64,
}

/// Help of `--prior`, with the names that there are.
fn prior_help() -> String {
    format!("Prior: {}, or a file", PriorSet::embedded_names().collect::<Vec<_>>().join(", "))
}

impl Model {
    /// The base law as it was asked for: its name or file, or the address of another program's, with `#` and its model's name.
    pub fn law(&self) -> Option<String> {
        let model = self.forward_model.as_ref().map_or(String::new(), |name| format!("#{name}"));
        self.forward.as_ref().map(|url| format!("{url}{model}")).or_else(|| self.base.clone())
    }
}

/// Arguments of `sample`.
#[derive(Args)]
pub struct SampleArguments {
    #[command(flatten)]
    pub common: Common,
    /// More records of the same specimen, creep or oscillation: one law is sampled for all
    #[arg(value_name = "EXPERIMENT")]
    pub others: Vec<PathBuf>,
    #[command(flatten)]
    pub model: Model,
    #[command(flatten)]
    pub page: PageArguments,
    /// Walkers of each of the independent ensembles
    #[arg(long, value_name = "N", default_value_t = SamplerOptions::default().n_walkers, allow_negative_numbers = true)]
    pub chains: usize,
    /// Steps of each walker after which the run ends, converged or not
    #[arg(long, value_name = "N", default_value_t = SamplerOptions::default().max_steps, allow_negative_numbers = true)]
    pub steps: u64,
    /// Go on from where an interrupted run of the same command stopped
    #[arg(long)]
    pub resume: bool,
}

/// Arguments of `fit`.
#[derive(Args)]
pub struct FitArguments {
    #[command(flatten)]
    pub common: Common,
    #[command(flatten)]
    pub model: Model,
}

/// Arguments of `simulate`.
#[derive(Args)]
pub struct SimulateArguments {
    #[command(flatten)]
    pub common: Common,
    #[command(flatten)]
    pub model: Model,
    /// Also print a convergence table over the built-in meshes of levels 1 to N
    #[arg(long, value_name = "N")]
    pub refine: Option<usize>,
    /// Time integrator [default: exponential for a law of springs and dashpots alone, radau with effects]
    #[arg(long, value_name = "SCHEME", value_enum)]
    pub scheme: Option<Scheme>,
    /// Longest step of the midpoint scheme [default: one step from row to row]
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    pub time_step_s: Option<f64>,
}

/// Time integrators.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Scheme {
    /// Exact while the force holds
    Exponential,
    /// Implicit midpoint rule, second order
    Midpoint,
    /// Implicit Runge-Kutta of fifth order, for any model
    Radau,
}

/// Arguments of `effects`.
#[derive(Args)]
pub struct EffectsArguments {
    #[command(flatten)]
    pub common: Common,
    #[command(flatten)]
    pub model: Model,
}

/// Arguments of `compare`.
#[derive(Args)]
pub struct CompareArguments {
    #[command(flatten)]
    pub common: Common,
    #[command(flatten)]
    pub model: Model,
    #[command(flatten)]
    pub page: PageArguments,
    /// Simulated records by which the looks are corrected together [default: 199; beyond 15,000 fitted rows fewer, 59 at least]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub simulations: Option<usize>,
}

/// Arguments of `diagnose`.
#[derive(Args)]
pub struct DiagnoseArguments {
    #[command(flatten)]
    pub common: Common,
    /// More experiments or studies, or a directory of them in the first one's place: what do these specimens lack together?
    #[arg(value_name = "DIR")]
    pub others: Vec<PathBuf>,
    #[command(flatten)]
    pub model: Model,
    #[command(flatten)]
    pub page: PageArguments,
    /// Smallest change of a predicted position that is worth a claim, in noise standard deviations
    #[arg(long, value_name = "SIZE", default_value_t = 0.25, allow_negative_numbers = true)]
    pub smallest: f64,
    /// Most simulated searches by which a gain is judged; of a cohort, simulated records of each record
    #[arg(long, value_name = "N", default_value_t = 99)]
    pub simulations: usize,
    /// Of a cohort: what groups are formed by: species, region, or both [default: species, where there are several]
    #[arg(long, value_name = "KEYS", value_delimiter = ',')]
    pub by: Vec<String>,
    /// Of a cohort: ratios of sizes within 1 + MARGIN of 1 are no difference in practice
    #[arg(long, value_name = "MARGIN", default_value_t = 0.2, allow_negative_numbers = true)]
    pub margin: f64,
    /// Of a cohort: leave out a record (its directory or the directory's name) or a specimen (its id); may be repeated
    #[arg(long, value_name = "NAME")]
    pub leave_out: Vec<String>,
}

/// Arguments of `learn`.
#[derive(Args)]
pub struct LearnArguments {
    #[command(flatten)]
    pub common: Common,
    /// More experiments or studies, or a directory of them in the first one's place: learnt from half of them, confirmed on the others
    #[arg(value_name = "DIR")]
    pub others: Vec<PathBuf>,
    #[command(flatten)]
    pub model: Model,
    #[command(flatten)]
    pub page: PageArguments,
    /// Most simulated searches by which a gain is judged
    #[arg(long, value_name = "N", default_value_t = 99)]
    pub simulations: usize,
    /// Learn from the first N cycles and score all later ones [default: all but the last held-out one, which is scored]
    #[arg(long, value_name = "N")]
    pub first_cycles: Option<u32>,
    /// Functions of a state may only rise or only fall, as damage or hardening does
    #[arg(long)]
    pub monotone: bool,
}

/// Arguments of `extend`.
#[derive(Args)]
pub struct ExtendArguments {
    #[command(flatten)]
    pub common: Common,
    /// More experiments or studies, or a directory of them in the first one's place: each is extended alike
    #[arg(value_name = "DIR")]
    pub others: Vec<PathBuf>,
    #[command(flatten)]
    pub model: Model,
    #[command(flatten)]
    pub page: PageArguments,
    /// Walkers of each of the independent ensembles
    #[arg(long, value_name = "N", default_value_t = SamplerOptions::default().n_walkers, allow_negative_numbers = true)]
    pub chains: usize,
    /// Steps of each walker after which a run ends, converged or not
    #[arg(long, value_name = "N", default_value_t = SamplerOptions::default().max_steps, allow_negative_numbers = true)]
    pub steps: u64,
}

/// Arguments of `ladder`.
#[derive(Args)]
pub struct LadderArguments {
    #[command(flatten)]
    pub common: Common,
    #[command(flatten)]
    pub model: Model,
    #[command(flatten)]
    pub page: PageArguments,
    /// Walkers of each of the independent ensembles
    #[arg(long, value_name = "N", default_value_t = SamplerOptions::default().n_walkers, allow_negative_numbers = true)]
    pub chains: usize,
    /// Steps of each walker after which a run ends, converged or not
    #[arg(long, value_name = "N", default_value_t = SamplerOptions::default().max_steps, allow_negative_numbers = true)]
    pub steps: u64,
}

/// Arguments of `corner`.
#[derive(Args)]
pub struct CornerArguments {
    /// Studies (their last revision is taken), revisions (study/m0), or CSV files of draws with one column a parameter
    /// [default: the study of the embedded porcine replica]
    #[arg(value_name = "STUDY|REVISION|DRAWS.csv")]
    pub paths: Vec<PathBuf>,
    /// Where the figure goes, without extension: FILE.svg and FILE.png are written
    #[arg(long, value_name = "FILE", default_value = "corner")]
    pub out: PathBuf,
    /// Mark a value of a parameter; may be repeated
    #[arg(long, value_name = "NAME=VALUE")]
    pub reference: Vec<String>,
    /// Write what was drawn and where as one JSON document to a file, or alone to standard output with `-`
    #[arg(long, value_name = "FILE|-")]
    pub json: Option<PathBuf>,
    /// Do not say where the figure went
    #[arg(long)]
    pub quiet: bool,
}

/// The sampler's settings from the options; `threads` as [`use_threads`] gives them.
pub fn sampler(chains: usize, steps: u64, seed: u64, threads: usize) -> SamplerOptions {
    SamplerOptions { n_walkers: chains, max_steps: steps, seed, threads, ..SamplerOptions::default() }
}

/// The same for commands that have no options for it.
pub fn default_sampler(seed: u64, threads: usize) -> SamplerOptions {
    SamplerOptions { seed, threads, ..SamplerOptions::default() }
}

/// Most simulations: a probability of a thousandth is known to a tenth of itself by them.
const MOST_SIMULATIONS: usize = 100_000;

/// Refuses fewer simulations than can show the smallest p that a command asks for, and more than any question needs.
pub fn check_simulations(simulations: usize, fewest: usize) -> vitreo_uq::Result<()> {
    let (found, remedy) = if simulations < fewest {
        (
            format!("{simulations} simulations cannot show a p as small as is asked for"),
            format!("give at least {fewest}"),
        )
    } else if simulations > MOST_SIMULATIONS {
        (format!("{simulations} simulations"), format!("give at most {MOST_SIMULATIONS}; hundreds are usual"))
    } else {
        return Ok(());
    };
    Err(Error::input(Place::default().at_key("--simulations"), found, remedy))
}

/// Uses so many threads everywhere (0: as many as the environment says, or as there are cores), at most one a core: more would only get in each
/// other's way. Returns how many.
pub fn use_threads(threads: usize) -> vitreo_uq::Result<usize> {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let asked = match threads {
        0 => std::env::var(vitreo_uq::posterior::monitor::THREADS_VARIABLE)
            .ok()
            .and_then(|text| text.parse().ok())
            .filter(|threads| *threads > 0),
        threads => Some(threads),
    };
    let threads = asked.map_or(cores, |asked| asked.min(cores));
    rayon::ThreadPoolBuilder::new().num_threads(threads).build_global().map_err(|error| {
        vitreo_uq::Error::numerical(format!("no threads to be had: {error}"), "use fewer threads (--threads)")
    })?;
    Ok(threads)
}
