//! `serve`: lets other programs evaluate the models of a study, by the UM-Bridge protocol.

use std::net::{IpAddr, Ipv4Addr};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;

use axum::body::Bytes;
use axum::extract::DefaultBodyLimit;
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use axum::routing::{MethodRouter, get, post};
use axum::{Router, middleware};
use clap::Args;
use serde_json::json;
use tokio::sync::Semaphore;
use vitreo_uq::base::error::{Error, Result};
use vitreo_uq::documents::posterior::Warning;
use vitreo_uq::figures::labels::model_title;
use vitreo_uq::figures::number::format_ranges;
use vitreo_uq::jobs::bridge::{BridgeModels, Endpoint, MAX_POINTS, NEGATIVE_INFINITY_SUBSTITUTE};
use vitreo_uq::jobs::first_revision::{kept_surrogate, with_fitted_cycles_of};
use vitreo_uq::jobs::target::CreepTarget;
use vitreo_uq::posterior::advice::check_warning;
use vitreo_uq::posterior::monitor::Monitor;
use vitreo_uq::posterior::prepared::{PreparedModel, Verification};

use crate::guard::{Guard, guard};
use crate::interrupt::print_message;
use crate::options::{self, Common, ModelOptions, OutputOptions};
use crate::session::target_request;
use crate::terminal::Terminal;
use crate::text::significant;
use crate::{http, output};

/// Arguments of `serve`.
#[derive(Args)]
pub struct ServeArguments {
    /// Experiment (a directory with experiment.toml, or that file) or study, whose last revision is served [default: the embedded porcine replica]
    #[arg(value_name = "EXPERIMENT|STUDY")]
    target: Option<PathBuf>,
    /// Port; 0 for any free port
    #[arg(long, value_name = "N", default_value_t = 4242)]
    port: u16,
    /// Address to listen on, if other machines need the models; the protocol has no password
    #[arg(long, value_name = "ADDRESS", default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST))]
    host: IpAddr,
    /// Additional host name that requests may use, besides addresses, localhost and this machine's name; may be repeated
    #[arg(long, value_name = "NAME")]
    allow_host: Vec<String>,
    /// Number of requests to process at once; 0 for as many as there are cores
    #[arg(long, value_name = "N", default_value_t = 0, allow_negative_numbers = true)]
    threads: usize,
    /// Do not show progress on standard error, and print only the link on standard output
    #[arg(long)]
    quiet: bool,
    #[command(flatten)]
    model: ModelOptions,
}

pub fn run(arguments: &ServeArguments) -> Result<ExitCode> {
    let threads = options::use_threads(arguments.threads)?;
    let (listener, address) = http::listen(arguments.host, &[arguments.port])?;
    let terminal = Terminal::new(arguments.quiet);
    let output = OutputOptions { json: None, seed: 1, threads, quiet: arguments.quiet };
    let common = Common { target: arguments.target.clone(), out: None, output, force: false };
    let mut target = CreepTarget::open(target_request(&common, &arguments.model, &[]), None, &terminal)?;
    target.check(&terminal)?;
    let revision = match (&arguments.model.from, target.existing_study()) {
        (None, Some(study)) => study.revisions()?.pop(),
        (from, _) => from.clone(),
    };
    target.experiment = with_fitted_cycles_of(target.experiment, revision.as_deref());
    let problem = target.problem(&terminal)?;
    let kept = target.existing_study().and_then(|study| kept_surrogate(study, &terminal));
    // The model is never freed, because tasks use it until the program ends.
    let model: &'static PreparedModel = Box::leak(Box::new(PreparedModel::new(&problem, kept, &terminal)?));
    let models = Arc::new(BridgeModels::new(model)?);
    let check = model.verify_now(&terminal)?;
    terminal.finish();
    if let Some(Warning { text, advice, .. }) = check.as_ref().and_then(check_warning) {
        terminal.warn(&format!("{text}\n  what to do: {advice}"));
    }
    output::print(&format!("http://{address}\n"))?;
    if !arguments.quiet {
        output::print(&words(model, &models, check))?;
        if !address.ip().is_loopback() {
            print_message("note: other machines can reach these models and use this machine's processors");
        }
        print_message("Serving; Ctrl-C ends the server.");
    }
    let refused = |error| Error::at_path("serve", address.to_string(), error, "start the command again");
    let guard = Guard::new(address, &arguments.allow_host);
    http::serve(listener, || router(models, threads, guard)).map_err(refused)?;
    Ok(ExitCode::SUCCESS)
}

/// State that all request handlers share.
#[derive(Clone)]
struct ServerState {
    models: Arc<BridgeModels<'static>>,
    /// Semaphore that limits the number of requests that are processed at once.
    free: Arc<Semaphore>,
}

fn router(models: Arc<BridgeModels<'static>>, threads: usize, names: Guard) -> Router {
    let most_bytes = models.max_request_bytes();
    let shared = ServerState { models, free: Arc::new(Semaphore::new(threads)) };
    let endpoint = |endpoint: Endpoint| -> MethodRouter {
        let shared = shared.clone();
        let answer = move |body: Bytes| answer(shared, endpoint, body);
        if endpoint == Endpoint::Info { get(answer) } else { post(answer) }
    };
    let nothing = || async { (StatusCode::NOT_FOUND, "This is a server of UM-Bridge models. Request /Info.\n") };
    let routes = Endpoint::ALL.into_iter();
    let router = routes.fold(Router::new(), |router, entry| router.route(entry.path(), endpoint(entry)));
    let guarded = middleware::from_fn_with_state(names, guard);
    router
        .layer(middleware::from_fn(http::whole_body))
        .layer(DefaultBodyLimit::max(most_bytes))
        .fallback(nothing)
        .layer(guarded)
}

/// Computes a response on a separate thread, so that long requests do not block the server.
async fn answer(shared: ServerState, endpoint: Endpoint, body: Bytes) -> Response {
    let ServerState { models, free } = shared;
    // The error cannot occur, because the semaphore is never closed.
    let Ok(place) = free.acquire_owned().await else { return StatusCode::SERVICE_UNAVAILABLE.into_response() };
    let work = move || {
        let answer = models.answer(endpoint, &body);
        drop(place);
        let status = StatusCode::from_u16(answer.status).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR);
        http::json_body(status, &answer.body)
    };
    tokio::task::spawn_blocking(work).await.unwrap_or_else(|_| {
        let error = json!({ "error": { "type": "InvalidOutput", "message": "this request made the model fail; the reason is in the server's log" } });
        http::json_body(StatusCode::INTERNAL_SERVER_ERROR, &error)
    })
}

fn words(model: &PreparedModel, models: &BridgeModels, check: Option<Verification>) -> String {
    let problem = &model.problem;
    let experiment = &problem.experiment;
    let (inputs, n) = (models.inputs(), models.n_trajectory_inputs());
    let cycles = &experiment.calibration_cycles;
    let mut lines = vec![
        format!(
            "{}: {} model, {} noise; fitted: cycle{} {}",
            experiment.specimen_id,
            model_title(&problem.specification.summary()),
            problem.noise.names().join(" + "),
            if cycles.len() == 1 { "" } else { "s" },
            format_ranges(cycles)
        ),
        String::new(),
    ];
    let width = inputs.iter().map(|input| input.prior.name.len()).max().unwrap_or(0).max("input".len());
    lines.push(format!("  {:>3}  {:<width$}  {:<8}{:>11}{:>11}  prior", "", "input", "unit", "from", "to"));
    for (place, input) in inputs.iter().enumerate() {
        let (prior, (lower, upper)) = (&input.prior, input.ends);
        let end = |value: f64| if value.is_finite() { significant(value) } else { "–".into() };
        let (name, unit) = (&prior.name, &prior.unit);
        lines.push(format!(
            "  {:>3}  {name:<width$}  {unit:<8}{:>11}{:>11}  {}",
            place + 1,
            end(lower),
            end(upper),
            prior.distribution
        ));
    }
    lines.push(String::new());
    lines.push(format!(
        "trajectory: [[inputs 1 to {n}]] → [[{} positions in um, one for each row of the record]]",
        models.n_rows()
    ));
    if let Some(Verification { n_runs, relative_error }) = check {
        lines.push(
            "  config {\"model\": \"reduced\"} (default) for the surrogate, or {\"model\": \"full\"} for full finite elements;"
                .into(),
        );
        lines.push(match n_runs {
            0 => "  surrogate and full finite elements could not be compared: the model has no trajectory at the points tried.".into(),
            _ => format!(
                "  surrogate and full finite elements differ by up to {relative_error:.0e} of the amplitude, measured at {n_runs} points of the prior."
            ),
        });
    }
    lines.push(format!(
        "posterior: [[inputs 1 to {}]] → [[ln(prior × likelihood), as a density over these inputs]]",
        inputs.len()
    ));
    lines.push(format!("  config {{\"points\": N}} for N points in sequence, at most {MAX_POINTS};"));
    lines.push(format!(
        "  {NEGATIVE_INFINITY_SUBSTITUTE:e} means −∞: outside the range of an input, or where an effect has no model."
    ));
    lines.push("Gradient and ApplyJacobian work for both models, by surrogate; ApplyHessian is not supported.".into());
    lines.join("\n") + "\n"
}
