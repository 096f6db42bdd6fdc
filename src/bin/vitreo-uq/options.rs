//! Command-line options that several commands share, and the arguments of most commands.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use vitreo_uq::base::error::{Error, InputPlace};
use vitreo_uq::posterior::prior::PriorSet;
use vitreo_uq::sampling::SamplerOptions;

use crate::report::PageArguments;

/// Options of the output, the random numbers and the threads.
#[derive(Args, Clone)]
pub struct OutputOptions {
    /// Write the result as one JSON document to a file, or with `-` to standard output in place of the text
    #[arg(long, value_name = "FILE|-")]
    pub json: Option<PathBuf>,
    /// Seed of all random numbers
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true)]
    pub seed: u64,
    /// Number of threads; 0 for as many as there are cores
    #[arg(long, value_name = "N", default_value_t = 0, allow_negative_numbers = true)]
    pub threads: usize,
    /// Do not show progress on standard error
    #[arg(long)]
    pub quiet: bool,
}

/// Options that most commands share.
#[derive(Args, Clone)]
pub struct Common {
    /// Experiment (a directory with experiment.toml, or that file) or study [default: the embedded porcine replica]
    #[arg(value_name = "EXPERIMENT|STUDY")]
    pub target: Option<PathBuf>,
    /// Study directory [default: vitreo-uq-out/<specimen id>]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    #[command(flatten)]
    pub output: OutputOptions,
    /// Replace a study or revision that was made from another input or model
    #[arg(long)]
    pub force: bool,
}

/// Options that choose the model of an experiment.
#[derive(Args, Clone, Default)]
pub struct ModelOptions {
    /// Base law: lethersich, burgers, two-element, maxwell, kelvin-voigt, standard-linear-solid, springpot, fractional-kelvin-voigt, fractional-maxwell, spring-springpot, two-mode-maxwell, or a TOML file with a [base.network]
    #[arg(long, value_name = "LAW|FILE.toml")]
    pub base: Option<String>,
    /// Use the model of another program: the address of a UM-Bridge server; the prior names the parameters of its model
    #[arg(long, value_name = "http://HOST:PORT", conflicts_with = "base")]
    pub forward: Option<String>,
    /// Name of the server's model [default: `forward`, or its only model]
    #[arg(long, value_name = "NAME", requires = "forward")]
    pub forward_model: Option<String>,
    /// Effects to add, separated by commas: names that `effects` lists, or files that define an effect
    #[arg(long, value_name = "SLUG|FILE.toml", value_delimiter = ',')]
    pub with: Vec<String>,
    /// Noise terms, separated by commas: white, ou, gain, student
    #[arg(long, value_name = "TERM", value_delimiter = ',')]
    pub noise: Vec<String>,
    #[arg(long, value_name = "NAME|FILE", help = prior_help())]
    pub prior: Option<String>,
    /// Fix a parameter (in `simulate`: set its value), or free a fixed one with NAME=free; may be repeated
    #[arg(long, value_name = "NAME=VALUE")]
    pub set: Vec<String>,
    /// Start from the model of this revision of a study [default: the last]
    #[arg(long, value_name = "REV")]
    pub from: Option<String>,
    /// Gmsh 4.1 mesh of the quarter model, in place of the built-in mesh
    #[arg(long, value_name = "FILE.msh")]
    pub mesh: Option<PathBuf>,
    /// Length unit of the mesh in `--mesh`, in m
    #[arg(long, value_name = "METRES", default_value_t = 1e-3)]
    pub mesh_unit: f64,
}

/// Help of `--prior`, with the names of the embedded priors.
fn prior_help() -> String {
    format!("Prior: {}, or a file", PriorSet::builtin_names().collect::<Vec<_>>().join(", "))
}

impl ModelOptions {
    /// Returns the base law as the user gives it: a name or file, or the address of another program's server with `#` and the name of its model.
    pub fn law(&self) -> Option<String> {
        let model = self.forward_model.as_ref().map_or(String::new(), |name| format!("#{name}"));
        self.forward.as_ref().map(|url| format!("{url}{model}")).or_else(|| self.base.clone())
    }
}

/// Options of the sampler.
#[derive(Args)]
pub struct Walkers {
    /// Number of walkers of each of the independent ensembles
    #[arg(long, value_name = "N", default_value_t = SamplerOptions::default().n_walkers, allow_negative_numbers = true)]
    pub chains: usize,
    /// Maximum number of steps of each walker
    #[arg(long, value_name = "N", default_value_t = SamplerOptions::default().max_steps, allow_negative_numbers = true)]
    pub steps: u64,
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
    pub model: ModelOptions,
    #[command(flatten)]
    pub page: PageArguments,
    #[command(flatten)]
    pub walkers: Walkers,
    /// Continue an interrupted run of the same command
    #[arg(long)]
    pub resume: bool,
}

/// Arguments of `fit` and `effects`.
#[derive(Args)]
pub struct ModelArguments {
    #[command(flatten)]
    pub common: Common,
    #[command(flatten)]
    pub model: ModelOptions,
}

/// Arguments of `simulate`.
#[derive(Args)]
pub struct SimulateArguments {
    #[command(flatten)]
    pub common: Common,
    #[command(flatten)]
    pub model: ModelOptions,
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
    /// Exact for piecewise constant force
    Exponential,
    /// Implicit midpoint rule, second order
    Midpoint,
    /// Implicit Runge-Kutta of fifth order, for any model
    Radau,
}

/// Arguments of `compare`.
#[derive(Args)]
pub struct CompareArguments {
    #[command(flatten)]
    pub common: Common,
    #[command(flatten)]
    pub model: ModelOptions,
    #[command(flatten)]
    pub page: PageArguments,
    /// Compare base laws instead: their evidence and their errors on the last cycle. Names or files of laws, separated by commas [default: all named laws]
    #[arg(long, value_name = "LIST", num_args = 0..=1, default_missing_value = "", value_delimiter = ',', conflicts_with_all = ["simulations", "base"])]
    pub laws: Option<Vec<String>>,
    /// Number of simulated records by which p is corrected for the number of tests [default: 199; fewer above 15,000 fitted rows, but at least 59]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub simulations: Option<usize>,
}

/// Arguments of `diagnose`.
#[derive(Args)]
pub struct DiagnoseArguments {
    #[command(flatten)]
    pub common: Common,
    /// More experiments or studies (or give only one directory that contains them): find the effects that all these specimens lack
    #[arg(value_name = "DIR")]
    pub others: Vec<PathBuf>,
    #[command(flatten)]
    pub model: ModelOptions,
    #[command(flatten)]
    pub page: PageArguments,
    /// Smallest change of a predicted position that counts as an effect, in noise standard deviations
    #[arg(long, value_name = "SIZE", default_value_t = 0.25, allow_negative_numbers = true)]
    pub smallest: f64,
    /// Maximum number of simulated searches from which the p of a gain is computed; for a cohort, the number of simulated records for each record
    #[arg(long, value_name = "N", default_value_t = 99)]
    pub simulations: usize,
    /// Cohorts only: keys that define the groups: species, region, or both [default: species, if there are several]
    #[arg(long, value_name = "KEYS", value_delimiter = ',')]
    pub by: Vec<String>,
    /// Cohorts only: ratios of sizes from 1/(1 + MARGIN) to 1 + MARGIN count as no difference in practice
    #[arg(long, value_name = "MARGIN", default_value_t = 0.2, allow_negative_numbers = true)]
    pub margin: f64,
    /// Cohorts only: leave out a record (its directory or the directory's name) or a specimen (its id); may be repeated
    #[arg(long, value_name = "NAME")]
    pub leave_out: Vec<String>,
    /// Single records only: list every candidate effect, the noise estimates, the smallest detectable sizes and all notes
    #[arg(long)]
    pub verbose: bool,
}

/// Arguments of `learn`.
#[derive(Args)]
pub struct LearnArguments {
    #[command(flatten)]
    pub common: Common,
    /// More experiments or studies (or give only one directory that contains them): learn from half of the records, and confirm on the other half
    #[arg(value_name = "DIR")]
    pub others: Vec<PathBuf>,
    #[command(flatten)]
    pub model: ModelOptions,
    #[command(flatten)]
    pub page: PageArguments,
    /// Maximum number of simulated searches from which the p of a gain is computed
    #[arg(long, value_name = "N", default_value_t = 99)]
    pub simulations: usize,
    /// Learn from the first N cycles and score all later ones [default: score the last held-out cycle and learn from all others]
    #[arg(long, value_name = "N")]
    pub first_cycles: Option<u32>,
    /// Allow only monotone functions of a state, such as those of damage or hardening
    #[arg(long)]
    pub monotone: bool,
}

/// Arguments of `extend`.
#[derive(Args)]
pub struct ExtendArguments {
    #[command(flatten)]
    pub common: Common,
    /// More experiments or studies (or give only one directory that contains them): extend every record in the same way
    #[arg(value_name = "DIR")]
    pub others: Vec<PathBuf>,
    #[command(flatten)]
    pub model: ModelOptions,
    #[command(flatten)]
    pub page: PageArguments,
    #[command(flatten)]
    pub walkers: Walkers,
}

/// Arguments of `ladder`.
#[derive(Args)]
pub struct LadderArguments {
    #[command(flatten)]
    pub common: Common,
    #[command(flatten)]
    pub model: ModelOptions,
    #[command(flatten)]
    pub page: PageArguments,
    #[command(flatten)]
    pub walkers: Walkers,
}

/// Arguments of `corner`.
#[derive(Args)]
pub struct CornerArguments {
    /// Studies (their last revision is used), revisions (study/m0), or CSV files of draws with one column per parameter
    /// [default: the study of the embedded porcine replica]
    #[arg(value_name = "STUDY|REVISION|DRAWS.csv")]
    pub paths: Vec<PathBuf>,
    /// File name of the figure without extension; FILE.svg, FILE.png and FILE.pdf are written
    #[arg(long, value_name = "FILE", default_value = "corner")]
    pub out: PathBuf,
    /// Draw only these parameters, separated by commas, by their names in draws.csv
    #[arg(long, value_name = "NAME,…", value_delimiter = ',')]
    pub parameters: Vec<String>,
    /// Mark this value of a parameter; may be repeated
    #[arg(long, value_name = "NAME=VALUE")]
    pub reference: Vec<String>,
    /// Write the list of posteriors and files as one JSON document to a file, or with `-` to standard output in place of the text
    #[arg(long, value_name = "FILE|-")]
    pub json: Option<PathBuf>,
    /// Do not print the path of the figure
    #[arg(long)]
    pub quiet: bool,
}

/// Sampler settings for commands with options for chains and steps; `threads` is the result of [`use_threads`].
pub fn sampler(chains: usize, steps: u64, seed: u64, threads: usize) -> SamplerOptions {
    SamplerOptions { n_walkers: chains, max_steps: steps, seed, threads, ..SamplerOptions::default() }
}

/// Sampler settings for commands without options for chains and steps.
pub fn default_sampler(seed: u64, threads: usize) -> SamplerOptions {
    SamplerOptions { seed, threads, ..SamplerOptions::default() }
}

/// Maximum number of simulations. With this number, a probability of 0.001 has a relative error of a tenth.
const MOST_SIMULATIONS: usize = 100_000;

/// Refuses a number of simulations that is below `fewest`, which the command needs to resolve its required p, or that is larger than useful.
pub fn check_simulations(simulations: usize, fewest: usize) -> vitreo_uq::Result<()> {
    let (found, remedy) = if simulations < fewest {
        (
            format!("{simulations} simulations cannot resolve the p that this command requires"),
            format!("give at least {fewest}"),
        )
    } else if simulations > MOST_SIMULATIONS {
        (format!("{simulations} simulations"), format!("give at most {MOST_SIMULATIONS}; a few hundred are usual"))
    } else {
        return Ok(());
    };
    Err(Error::input(InputPlace::default().at_key("--simulations"), found, remedy))
}

/// The value of an option that must be above 0 and at most `largest`.
pub fn positive(option: &str, value: Option<f64>, largest: f64) -> vitreo_uq::Result<Option<f64>> {
    match value {
        Some(value) if !(value > 0.0 && value <= largest) => Err(Error::input(
            InputPlace::default().at_key(option),
            format!("{value}"),
            format!("give a number above 0 and at most {largest}"),
        )),
        other => Ok(other),
    }
}

/// Sets the number of threads and returns it. The number 0 means the number in the environment variable `RAYON_NUM_THREADS`, or else all cores. More threads
/// than cores are never used.
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
        vitreo_uq::Error::numerical(format!("the threads cannot be started: {error}"), "use fewer threads (--threads)")
    })?;
    Ok(threads)
}
