//! `design`: the protocol of the next record.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, ValueEnum};
use vitreo_uq::base::error::Result;
use vitreo_uq::documents::design::{Design, DesignedDetection, FrontProtocol};
use vitreo_uq::figures::labels::parameter_label;
use vitreo_uq::jobs::design::{self, DesignGoal, DesignRequest, Unmeasured, run_before_measurement};

use crate::options::{Common, ModelOptions, positive};
use crate::predict::warning_lines;
use crate::report::PageArguments;
use crate::session::{Session, target_request};
use crate::text::significant;

/// Arguments of `design`.
#[derive(Args)]
pub struct DesignArguments {
    #[command(flatten)]
    common: Common,
    #[command(flatten)]
    model: ModelOptions,
    /// Purpose [default: effects, if a diagnosis could not distinguish some; otherwise parameters]
    #[arg(long, value_name = "GOAL", value_enum)]
    goal: Option<Goal>,
    /// File whose first [[scenario]] has the quantity of a decision (docs/predict.md); chooses the goal `decision`
    #[arg(long, value_name = "FILE.toml")]
    scenario: Option<PathBuf>,
    /// Later record of the specimen on the same apparatus (a directory with experiment.toml); may be repeated
    #[arg(long, value_name = "EXPERIMENT")]
    after: Vec<PathBuf>,
    /// Duration of the new record, in s [default: that of the present record]
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    budget_s: Option<f64>,
    /// Largest force in µN [default: that of the present record]
    #[arg(long, value_name = "MICRONEWTON", allow_negative_numbers = true)]
    max_force_un: Option<f64>,
    /// Largest distance from the start, in µm [default: 1.05 times that of the present record]
    #[arg(long, value_name = "MICROMETRE", allow_negative_numbers = true)]
    max_displacement_um: Option<f64>,
    /// Time between samples, in s [default: that of the present record]
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    interval_s: Option<f64>,
    /// Shortest time for which a force is held, in s [default: four samples]
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    min_hold_s: Option<f64>,
    /// Allow forces of both directions, even if the present record has one direction
    #[arg(long)]
    both_directions: bool,
    #[command(flatten)]
    page: PageArguments,
}

/// Purposes of a design.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Goal {
    /// Smallest uncertainty of the parameters
    Parameters,
    /// Tell the equivalent effects of the last diagnosis apart
    Effects,
    /// Smallest detectable sizes of the effects that the model lacks
    Detection,
    /// Smallest uncertainty of the quantity of `--scenario`
    Decision,
}

pub fn run(arguments: &DesignArguments) -> Result<ExitCode> {
    let budget_s = positive("--budget-s", arguments.budget_s, 864_000.0)?;
    let largest_force_un = positive("--max-force-un", arguments.max_force_un, 1e9)?;
    let largest_position_um = positive("--max-displacement-um", arguments.max_displacement_um, 1e9)?;
    let interval_s = positive("--interval-s", arguments.interval_s, 3_600.0)?;
    let shortest_hold_s = positive("--min-hold-s", arguments.min_hold_s, 86_400.0)?;
    let session = Session::begin(&arguments.common)?;
    let request = DesignRequest {
        goal: arguments.goal.map(|goal| match goal {
            Goal::Parameters => DesignGoal::Parameters,
            Goal::Effects => DesignGoal::Effects,
            Goal::Detection => DesignGoal::Detection,
            Goal::Decision => DesignGoal::Decision,
        }),
        scenario: arguments.scenario.clone(),
        budget_s,
        largest_force_n: largest_force_un.map(|un| 1e-6 * un),
        interval_s,
        shortest_hold_s,
        largest_position_m: largest_position_um.map(|um| 1e-6 * um),
        both_directions: arguments.both_directions,
        after: arguments.after.clone(),
        sampler: session.default_sampler(),
    };
    let outcome = match arguments.common.target.as_deref().and_then(Unmeasured::read) {
        Some(unmeasured) => {
            let target = target_request(&arguments.common, &arguments.model, &[]);
            run_before_measurement(unmeasured, &target, &request, &session.terminal)
        }
        None => design::run(&session.open(&arguments.model, &[], &[])?, &request, &session.terminal),
    }?;
    session.end(&outcome, &words(&outcome.document.body), "Figure", &arguments.page)
}

fn words(found: &Design) -> String {
    let recommended = &found.recommended;
    let mut lines = vec![format!("{} ({}): design for the {}", found.experiment, found.revision, found.goal)];
    lines.extend(found.stop.clone());
    lines.push(recommended.sentence.clone());
    lines.push(String::new());
    if !found.models.is_empty() {
        lines
            .push(format!("  {:<44}{:>18}{:>14}", "model after the records so far", "trails by (nats)", "probability"));
        lines.extend(found.models.iter().map(|model| {
            let probability = format!("{:.1} %", 100.0 * model.probability);
            format!("  {:<44}{:>18}{probability:>14}", model.effects, significant(model.trails_by_nats))
        }));
        lines.push(String::new());
    }
    lines.push(format!("  {:<34}{:>14}{:>14}{:>14}", "parameter", "value", "± now", "± expected"));
    for parameter in &recommended.parameters {
        lines.push(format!(
            "  {:<34}{:>14}{:>14}{:>14}",
            parameter_label(&parameter.name).axis(),
            significant(parameter.value),
            significant(parameter.sd_now),
            significant(parameter.sd_expected)
        ));
    }
    if !found.detectable.is_empty() {
        lines.push(String::new());
        lines.push(format!("  {:<28}{:<34}{:>14}{:>14}", "smallest detectable size", "parameter", "now", "expected"));
        lines.extend(found.detectable.iter().map(detection_line));
    }
    lines.push(String::new());
    lines.push(format!("  {:>12}{:>20}{:>16}   {}", "duration (s)", "information (nats)", "distance (σ)", "protocol"));
    lines.extend(found.front.iter().map(front_line));
    for pair in &found.helpless {
        lines.push(String::new());
        lines.push(format!(
            "Not separated: {} and {}. Limit that would have to change: {}.",
            pair.pair[0], pair.pair[1], pair.limit
        ));
    }
    lines.push(String::new());
    lines.push(format!(
        "{} protocols were compared. Controller's file: {}. Description for the new record: {}",
        found.protocols_tried, recommended.protocol_file, recommended.record_dir
    ));
    lines.extend(warning_lines(&found.warnings));
    lines.join("\n") + "\n"
}

fn detection_line(found: &DesignedDetection) -> String {
    let size = |value: Option<f64>| value.map_or("none".into(), significant);
    let label = parameter_label(&found.parameter).axis();
    format!("  {:<28}{label:<34}{:>14}{:>14}", found.effect, size(found.smallest_now), size(found.smallest_expected))
}

fn front_line(entry: &FrontProtocol) -> String {
    let distance = entry.separation_sigma.map_or("–".into(), significant);
    format!(
        "  {:>12}{:>20}{distance:>16}   {}",
        significant(entry.duration_s),
        significant(entry.expected_information_nats),
        entry.protocol
    )
}
