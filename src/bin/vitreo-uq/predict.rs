//! `predict`: positions of robots in a gel whose parameters come from a study, a comparison of groups or a prior.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use vitreo_uq::base::error::{Error, InputPlace, Result};
use vitreo_uq::documents::posterior::Warning;
use vitreo_uq::documents::prediction::{GroupShare, Prediction, ScenarioPrediction};
use vitreo_uq::jobs::outcome::Outcome;
use vitreo_uq::jobs::prediction::predict::{self, PredictRequest};
use vitreo_uq::jobs::prediction::{GelPlace, is_groups};
use vitreo_uq::posterior::study::Study;
use vitreo_uq::sampling::SamplerOptions;

use crate::options::{Common, ModelOptions, OutputOptions};
use crate::report::PageArguments;
use crate::session::Session;
use crate::text::{significant, warning_text};

/// Arguments that `predict` and `plan` share.
#[derive(Args)]
pub struct GelArguments {
    /// Study, experiment, or directory that `groups` has written [default: the embedded porcine replica]
    #[arg(value_name = "STUDY|GROUPS")]
    target: Option<PathBuf>,
    /// Directory of the study, or of the results for a group or a prior [default: vitreo-uq-out/<specimen id>; for a group, its own]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    pub output: OutputOptions,
    /// Use this revision of the study [default: the last]
    #[arg(long, value_name = "REV")]
    from: Option<String>,
    /// Comparison of groups only: predict a new specimen of this group
    #[arg(long, value_name = "GROUP")]
    new_eye: Option<String>,
    /// Predict a gel of this prior, without a record: a name that `sample --help` lists, or a file
    #[arg(long, value_name = "NAME|FILE", conflicts_with_all = ["target", "new_eye", "from"])]
    prior: Option<String>,
    /// File with one or more [[scenario]]: robot, gel, force and quantities of interest (docs/predict.md)
    #[arg(long, value_name = "FILE.toml")]
    pub scenario: Option<PathBuf>,
    #[command(flatten)]
    pub page: PageArguments,
}

impl GelArguments {
    /// Options that every command has.
    pub fn common(&self) -> Common {
        Common { target: self.target.clone(), out: self.out.clone(), output: self.output.clone(), force: false }
    }

    /// Opens the source of the gel's parameters, and passes it to `run`.
    pub fn with_place<D>(
        &self,
        session: &Session<'_>,
        run: impl FnOnce(&GelPlace<'_>, SamplerOptions) -> Result<Outcome<D>>,
    ) -> Result<Outcome<D>> {
        let sampler = session.default_sampler();
        if let Some(name) = &self.prior {
            let stem = Path::new(name).file_stem().unwrap_or_default().to_string_lossy();
            let dir = self.out.clone().unwrap_or_else(|| Study::default_dir(&format!("prior-{stem}")));
            return run(&GelPlace::Prior { name, dir: &dir }, sampler);
        }
        if let Some(dir) = self.target.as_deref().filter(|dir| is_groups(dir)) {
            let place = GelPlace::Groups { dir, group: self.new_eye.as_deref(), out: self.out.as_deref() };
            return run(&place, sampler);
        }
        let refuse = |option: &str, found: String, remedy: String| {
            Err(Error::input(InputPlace::default().at_key(option), found, remedy))
        };
        if let Some(inner) = self.target.as_deref().and_then(inner_groups) {
            let found = "this directory contains comparisons of groups".into();
            return refuse("STUDY|GROUPS", found, format!("give one of them, such as {}", inner.display()));
        }
        if let Some(group) = &self.new_eye {
            let found = format!("a new specimen of `{group}` needs a comparison of groups");
            return refuse(
                "--new-eye",
                found,
                "run `vitreo-uq groups` first, and give the directory that it writes".into(),
            );
        }
        let model = ModelOptions { from: self.from.clone(), ..ModelOptions::default() };
        let target = session.open(&model, &[], &[])?;
        run(&GelPlace::Study(target.creep()?), sampler)
    }
}

/// Comparison of groups directly below a directory; `None` if there is none.
fn inner_groups(dir: &Path) -> Option<PathBuf> {
    let mut found: Vec<PathBuf> = dir.read_dir().ok()?.filter_map(|entry| Some(entry.ok()?.path())).collect();
    found.sort();
    found.into_iter().find(|inner| is_groups(inner))
}

/// Arguments of `predict`.
#[derive(Args)]
pub struct PredictArguments {
    #[command(flatten)]
    gel: GelArguments,
    /// Table with the header `time_s,force_un`, for scenarios without a force; without a scenario, for the study's own robot
    #[arg(long, value_name = "FILE.csv")]
    force: Option<PathBuf>,
}

pub fn run(arguments: &PredictArguments) -> Result<ExitCode> {
    let common = arguments.gel.common();
    let session = Session::begin(&common)?;
    let outcome = arguments.gel.with_place(&session, |place, sampler| {
        let request =
            PredictRequest { scenarios: arguments.gel.scenario.clone(), force: arguments.force.clone(), sampler };
        predict::run(place, &request, &session.terminal)
    })?;
    session.end(&outcome, &words(&outcome.document.body), "Figure", &arguments.gel.page)
}

fn words(found: &Prediction) -> String {
    let mut lines = vec![format!("Prediction for {}, {} draws", found.gel, found.draws)];
    for scenario in &found.scenarios {
        lines.push(String::new());
        lines.extend(scenario_lines(scenario));
        for other in found.equivalent.iter().filter(|other| other.scenario == scenario.name) {
            let verdict = if other.disagrees { "differs" } else { "agrees within the uncertainty" };
            lines.push(format!("  With {} instead, which the record cannot distinguish: {verdict}", other.effect));
            lines.extend(other.quantities.iter().map(|quantity| format!("    {}", quantity.sentence)));
        }
        let mut entries = found.sensitivity.iter().filter(|entry| entry.scenario == scenario.name).peekable();
        if entries.peek().is_some() {
            lines.push(String::new());
            lines.push(format!(
                "  {:<28}{:<24}{:>15}{:>15}{:>15}",
                "share of the variance", "input", "due to it", "first order", "total"
            ));
        }
        let mut partial: Vec<(&str, f64)> = Vec::new();
        for entry in entries {
            if entry.share_of_draws < 1.0 {
                partial.push((&entry.quantity, entry.share_of_draws));
            }
            let share = |value: f64, error: f64| format!("{value:.3} ± {error:.3}");
            let due = share(entry.shapley, entry.shapley_se);
            let [first, total] = [share(entry.first_order, entry.first_order_se), share(entry.total, entry.total_se)];
            lines.push(format!("  {:<28}{:<24}{due:>15}{first:>15}{total:>15}", entry.quantity, entry.input));
        }
        partial.dedup();
        lines.extend(partial.into_iter().map(|(quantity, share)| {
            format!("  {quantity}: the shares hold among the {:.1} % of draws that arrive", 100.0 * share)
        }));
        let of_group = found.group_shares.iter().filter(|share| share.scenario == scenario.name);
        lines.extend(of_group.map(|GroupShare { quantity, share, share_se, .. }| {
            format!("  {quantity}: {share:.2} ± {share_se:.2} of the variance is due to the uncertain group, which more specimens reduce")
        }));
        lines.extend(warning_lines(&scenario.warnings));
    }
    lines.extend(found.without_sensitivity.iter().map(|reason| format!("\n  {reason}.")));
    lines.extend(warning_lines(&found.warnings));
    lines.join("\n") + "\n"
}

/// Lines with the robot, the quantities and the numerical error of a scenario.
pub fn scenario_lines(scenario: &ScenarioPrediction) -> Vec<String> {
    let mut lines = vec![format!("{}: {}", scenario.name, scenario.apparatus)];
    lines.extend(scenario.quantities.iter().map(|quantity| format!("  {}", quantity.sentence)));
    let mesh = match scenario.mesh_error_um {
        None => "; the mesh's error is unknown".into(),
        Some(0.0) => "; the law has absorbed the mesh's error".into(),
        Some(error_um) => format!("; at most {} µm from the mesh", significant(error_um)),
    };
    let lines_of_sine = match scenario.force_error_um {
        0.0 => String::new(),
        error_um => format!("; at most {} µm from the straight lines of the sine", significant(error_um)),
    };
    lines.push(format!(
        "  Numerical error: {} µm from {} full finite-element runs{mesh}{lines_of_sine}",
        significant(scenario.full_model_error_um),
        scenario.full_runs
    ));
    lines
}

/// Warnings, each after an empty line.
pub fn warning_lines(warnings: &[Warning]) -> Vec<String> {
    warnings.iter().flat_map(|warning| [String::new(), warning_text(warning)]).collect()
}
