//! `groups`: compares the parameters of species or regions.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use clap::Args;
use vitreo_uq::base::error::{Error, InputPlace, Result, Setting};
use vitreo_uq::cohorts::cohort::{self, Key, Measurement};
use vitreo_uq::cohorts::job::{self, GroupsRequest};
use vitreo_uq::cohorts::summary;
use vitreo_uq::cohorts::{artefacts, wording};
use vitreo_uq::documents::groups::{ContrastSummary, GroupSummary, GroupsSummary, RatioVerdict, ScaleName};
use vitreo_uq::figures::labels::parameter_label;
use vitreo_uq::jobs::tasks::sample::Sampling;
use vitreo_uq::posterior::monitor::Monitor;
use vitreo_uq::posterior::study::WithProvenance;
use vitreo_uq::sampling::SamplerOptions;

use crate::options;
use crate::terminal::Terminal;
use crate::text::{significant, warning_text};

/// Arguments of `groups`.
#[derive(Args)]
pub struct GroupsArguments {
    #[command(flatten)]
    cohort: CohortArguments,
    /// Keys that define the groups: species, region, or both
    #[arg(long, value_name = "KEYS", value_delimiter = ',', default_value = "species")]
    by: Vec<String>,
    /// Ratios from 1/(1 + MARGIN) to 1 + MARGIN count as no difference in practice
    #[arg(long, value_name = "MARGIN", default_value_t = 0.2, allow_negative_numbers = true)]
    margin: f64,
    /// Let specimens scatter by a Student-t distribution, so that an outlying specimen does not widen its group
    #[arg(long)]
    heavy_tails: bool,
    /// Directory of the comparison and of its draws
    #[arg(long, value_name = "DIR", default_value = "vitreo-uq-out/groups")]
    out: PathBuf,
    /// Write the result as one JSON document to a file, or with `-` to standard output in place of the text
    #[arg(long, value_name = "FILE|-")]
    json: Option<PathBuf>,
    /// Maximum number of sweeps of each of the four chains that sample the population; sampling ends earlier if the draws converge
    #[arg(long, value_name = "N", default_value_t = 128_000)]
    sweeps: usize,
    /// Evaluate the likelihood of every experiment instead of re-weighting its draws; slower, for reference
    #[arg(long)]
    exact: bool,
    /// Number of threads; 0 for as many as there are cores
    #[arg(long, value_name = "N", default_value_t = 0, allow_negative_numbers = true)]
    threads: usize,
    /// Do not show progress on standard error
    #[arg(long)]
    quiet: bool,
    /// Replace an existing comparison of other experiments
    #[arg(long)]
    force: bool,
}

/// Options of `groups` and `tasks sample`: the experiments of a cohort, and the settings for sampling each of them alone.
#[derive(Args)]
pub struct CohortArguments {
    /// Experiments, studies (the model of their last revision is used), or directories that contain them
    #[arg(value_name = "DIR", required = true)]
    paths: Vec<PathBuf>,
    /// Leave out an experiment (its directory or the directory's name) or a specimen (its id); may be repeated
    #[arg(long, value_name = "NAME")]
    leave_out: Vec<String>,
    #[command(flatten)]
    sampling: SamplingArguments,
}

/// Options that choose the model of every experiment in a cohort.
#[derive(Args)]
pub struct ModelArguments {
    /// Base law of every experiment: lethersich, burgers, two-element, maxwell, kelvin-voigt, standard-linear-solid, springpot, fractional-kelvin-voigt, fractional-maxwell, spring-springpot, two-mode-maxwell, or a TOML file with a [base.network]
    #[arg(long, value_name = "LAW|FILE.toml")]
    base: Option<String>,
    /// Effects to add to every model, separated by commas
    #[arg(long, value_name = "SLUG", value_delimiter = ',')]
    with: Vec<String>,
    /// Noise terms, separated by commas: white, ou, gain, student
    #[arg(long, value_name = "TERM", value_delimiter = ',')]
    noise: Vec<String>,
    /// Prior (a name or a file) of each experiment's parameters and of the overall mean; the comparison divides it out of the experiments' posteriors
    #[arg(long, value_name = "NAME|FILE")]
    prior: Option<String>,
    /// Fix a parameter in every model; may be repeated
    #[arg(long, value_name = "NAME=VALUE")]
    set: Vec<String>,
}

impl ModelArguments {
    /// Settings for sampling an experiment: this model, with the default options of the sampler.
    pub fn sampling(&self) -> Sampling {
        let SamplerOptions { n_walkers, max_steps, seed, .. } = SamplerOptions::default();
        Sampling {
            base: self.base.clone(),
            with: self.with.clone(),
            noise: self.noise.clone(),
            prior: self.prior.clone(),
            set: self.set.clone(),
            n_walkers,
            max_steps,
            seed,
        }
    }
}

/// Options for the model and the sampler of every experiment.
#[derive(Args)]
pub struct SamplingArguments {
    #[command(flatten)]
    model: ModelArguments,
    /// Number of walkers of each of the ensembles that sample an experiment
    #[arg(long, value_name = "N", default_value_t = SamplerOptions::default().n_walkers, allow_negative_numbers = true)]
    chains: usize,
    /// Maximum number of steps of each walker in an experiment's run
    #[arg(long, value_name = "N", default_value_t = SamplerOptions::default().max_steps, allow_negative_numbers = true)]
    steps: u64,
    /// Seed of all random numbers
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true)]
    seed: u64,
}

impl SamplingArguments {
    /// Settings for sampling an experiment, from these options.
    pub fn sampling(&self) -> Sampling {
        Sampling { n_walkers: self.chains, max_steps: self.steps, seed: self.seed, ..self.model.sampling() }
    }
}

impl CohortArguments {
    /// Settings for sampling every experiment of the cohort.
    pub fn sampling(&self) -> Sampling {
        self.sampling.sampling()
    }

    /// Reads the experiments of the cohort, each with its model.
    pub fn read(&self, terminal: &Terminal) -> Result<Vec<Measurement>> {
        let sampling = self.sampling();
        cohort::read(&self.paths, &self.leave_out, &|model_specification| sampling.model(model_specification), terminal)
    }
}

/// Number of chains that sample the population.
const N_CHAINS: usize = 4;
/// Smallest number of sweeps for which R̂ and the effective sample size are valid.
const FEWEST_SWEEPS: usize = 400;
/// Maximum number of sweeps. So many sweeps take days.
const MOST_SWEEPS: usize = 1_000_000_000;

pub fn run(arguments: &GroupsArguments) -> Result<ExitCode> {
    let began = Instant::now();
    let keys = keys(&arguments.by)?;
    check(arguments)?;
    let threads = options::use_threads(arguments.threads)?;
    crate::output::check(arguments.json.as_deref())?;
    let SamplingArguments { chains, steps, seed, .. } = arguments.cohort.sampling;
    let sampler = options::sampler(chains, steps, seed, threads);
    let terminal = Terminal::new(arguments.quiet);
    let measurements = arguments.cohort.read(&terminal)?;
    let provenance = artefacts::provenance_of("groups", &measurements, seed);
    artefacts::check_place(&arguments.out, &keys, &provenance, arguments.force)?;
    let request = GroupsRequest {
        keys: &keys,
        margin: arguments.margin,
        is_heavy_tailed: arguments.heavy_tails,
        sampler,
        n_chains: N_CHAINS,
        max_sweeps: arguments.sweeps,
        is_exact: arguments.exact,
        kept: &arguments.out.join(artefacts::EXPERIMENTS),
    };
    let found = job::run(&measurements, &request, &terminal)?;
    terminal.stage("writing results and figures");
    let summary = summary::summarise(&measurements, &found, &request)?;
    let written = artefacts::write(&arguments.out, &keys, &found, &summary, provenance.clone())?;
    terminal.finish();
    let document = WithProvenance { provenance, body: &summary };
    crate::output::show(arguments.json.as_deref(), &document, &words(&summary))?;
    crate::output::print_result_path(arguments.quiet, &written, began);
    Ok(ExitCode::from(u8::from(!summary.is_sound())))
}

/// Parses the names of the keys that define the groups.
pub fn keys(names: &[String]) -> Result<Vec<Key>> {
    let refuse = |found: String| {
        Err(Error::input(InputPlace::setting(Setting::By), found, "group by `species`, `region` or `species,region`"))
    };
    let mut keys = Vec::new();
    for name in names {
        match Key::named(name.trim()) {
            Some(key) if keys.contains(&key) => return refuse(format!("`{name}` is given more than once")),
            Some(key) => keys.push(key),
            None => return refuse(format!("`{name}` is not a known key")),
        }
    }
    Ok(keys)
}

fn check(arguments: &GroupsArguments) -> Result<()> {
    if !(arguments.margin >= 0.0 && arguments.margin.is_finite()) {
        let found = format!("a margin of {}", arguments.margin);
        return Err(Error::input(
            InputPlace::default().at_key("--margin"),
            found,
            "give a fraction such as 0.2, for 20 %",
        ));
    }
    if !(FEWEST_SWEEPS..=MOST_SWEEPS).contains(&arguments.sweeps) {
        let found = format!("{} sweeps", arguments.sweeps);
        let remedy = format!("give at least {FEWEST_SWEEPS} and at most {MOST_SWEEPS}");
        return Err(Error::input(InputPlace::default().at_key("--sweeps"), found, remedy));
    }
    Ok(())
}

fn words(summary: &GroupsSummary) -> String {
    let mut text = String::new();
    let mut line = |words: String| {
        text += &words;
        text.push('\n');
    };
    line(wording::heading(summary));
    line(String::new());
    table(summary).into_iter().for_each(&mut line);
    if !summary.contrasts.is_empty() {
        line(String::new());
        ratios(summary).into_iter().for_each(&mut line);
        line(String::new());
        summary.sentences.iter().cloned().for_each(&mut line);
    }
    for warning in &summary.warnings {
        line(String::new());
        line(warning_text(warning));
    }
    text
}

/// Lines of a table of the groups: parameters of the typical specimen with their 90 % intervals, and the variation between specimens as a factor.
fn table(summary: &GroupsSummary) -> Vec<String> {
    let width = summary.groups.iter().map(|group| group.name.chars().count()).max().unwrap_or(0).max(5) + 2;
    let names = summary.groups.first().map_or(&[][..], |group| &group.parameters);
    let mut rows = vec![names.iter().fold(format!("  {:<width$}{:>9}", "group", "specimens"), |row, name| {
        row + &format!("{:>31}", parameter_label(&name.name).axis())
    })];
    rows.extend(summary.groups.iter().map(|group: &GroupSummary| {
        let count = if group.specimens == 0 { "predicted".into() } else { group.specimens.to_string() };
        group.parameters.iter().fold(format!("  {:<width$}{count:>9}", group.name), |row, parameter| {
            let [median, q05, q95] = [parameter.median, parameter.q05, parameter.q95].map(three_digits);
            let factor = parameter.between_specimen_log_sd.exp();
            row + &format!("{:>31}", format!("{median} ({q05}–{q95}) ×/÷ {factor:.2}"))
        })
    }));
    rows.push(
        "  Median of the typical specimen (its 90 % interval) ×/÷ one standard deviation between specimens.".into(),
    );
    let between_ends: Vec<String> = names
        .iter()
        .filter(|name| name.scale == ScaleName::LogOdds)
        .map(|group_parameter| parameter_label(&group_parameter.name).symbol)
        .collect();
    if !between_ends.is_empty() {
        rows.push(format!(
            "  For {}, which is bounded on both sides, ×/÷ applies to the ratio of the distances to the lower and upper bound.",
            between_ends.join(", ")
        ));
    }
    rows
}

/// Formats a value with three significant digits.
fn three_digits(value: f64) -> String {
    let digits = 2 - value.abs().log10().floor() as i32;
    if (0..=5).contains(&digits) { format!("{value:.*}", digits as usize) } else { significant(value) }
}

/// Lines of a table of the ratios between groups, one ratio per line. An asterisk marks a declared difference.
fn ratios(summary: &GroupsSummary) -> Vec<String> {
    let name = |contrast_summary: &ContrastSummary| {
        format!(
            "{} {} / {}",
            parameter_label(&contrast_summary.parameter).symbol,
            contrast_summary.a,
            contrast_summary.b
        )
    };
    let width = summary.contrasts.iter().map(|contrast| name(contrast).chars().count()).max().unwrap_or(0) + 2;
    let beyond = format!("P(> +{:.0} %)", 100.0 * summary.margin);
    let below = format!("P(< −{:.0} %)", 100.0 * (1.0 - 1.0 / (1.0 + summary.margin)));
    let mut rows =
        vec![format!("  {:<width$}{:>8}{:>17}{:>9}{beyond:>12}{below:>12}", "ratio", "median", "90 %", "P(> 1)")];
    rows.extend(summary.contrasts.iter().map(|contrast| {
        let mark = if contrast.is_declared { "*" } else { " " };
        let verdict = match contrast.verdict {
            RatioVerdict::Greater => "  greater",
            RatioVerdict::Less => "  less",
            RatioVerdict::Equivalent => "  no difference in practice",
            RatioVerdict::Undecided => "",
        };
        let more = contrast.more.map_or_else(String::new, |plan| format!("  {}", wording::required_specimens(&plan)));
        format!(
            "{mark} {:<width$}{:>8.2}{:>17}{:>9.3}{:>12.3}{:>12.3}{verdict}{more}",
            name(contrast),
            contrast.ratio_median,
            format!("{:.2}–{:.2}", contrast.q05, contrast.q95),
            contrast.probability_greater,
            contrast.probability_beyond_margin,
            contrast.probability_below_margin
        )
    }));
    rows.push("  * declared difference: its sign is certain (99.7 % probability that all declared signs are right), or it exceeds the margin (95 %).".into());
    rows
}
