//! HTTP server of the workbench: handles the requests of a page.

use std::net::TcpListener;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use axum::Router;
use axum::body::{Body, HttpBody, to_bytes};
use axum::extract::{DefaultBodyLimit, Extension, Json, Query, State};
use axum::http::{StatusCode, header};
use axum::middleware;
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use axum::routing::{MethodRouter, get, post};
use futures_util::stream;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use tokio::sync::watch;
use vitreo_uq::base::error::{Error, InputPlace, Result};
use vitreo_uq::base::files::{self, Content};
use vitreo_uq::base::quantities::Quantities;
use vitreo_uq::base::sha256::sha256_hex;
use vitreo_uq::figures::predictive::{CycleKind, CycleSpan};
use vitreo_uq::jobs::prediction::foresight::{Foresight, ForesightRequest};
use vitreo_uq::jobs::{artefacts, pages};
use vitreo_uq::posterior::study::{
    DIAGNOSIS_NAME, EXTENSION_NAME, FINDINGS_NAME, LADDER_NAME, LEARNED_NAME, ORIGINAL, POSTERIOR_NAME, Study,
};
use vitreo_uq::record::Experiment;

use super::choice::{RowChoice, apply_choice};
use super::home::{Item, WorkbenchFolder};
use super::jobs::{JobKind, JobRequest, Jobs};
use super::project::{self, RecordChange};
use super::rows::{CheckedRecord, FileCache, Window, read_record, read_revision, select_rows};
use super::tables::{self, Described};
use super::trial::{Trial, TrialRequest, trial};
use crate::corner;
use crate::guard::{Guard, guard};
use crate::http::{self, Connection};
use vitreo_uq::figures::predictions::Predictions;

/// Maximum time for the upload of a table.
const UPLOAD: Duration = Duration::from_secs(120);
/// Maximum size of an uploaded table, in bytes.
const LARGEST_UPLOAD: usize = 256 << 20;
/// Maximum size of the request of a job, which may name thousands of records, in bytes.
const LARGEST_JOB: usize = 1 << 20;
/// Maximum size of the body of all other requests, in bytes.
const MOST_BYTES: usize = 1 << 16;
/// Time between two checks whether other programs have changed the folder.
const LOOK: Duration = Duration::from_secs(2);

/// Files of a study may come from strangers: they run no script, not even one of this page.
const FILE_POLICY: &str = "sandbox; default-src 'none'; img-src data:; style-src 'unsafe-inline'";

/// Files of the page: path, media type and content.
const FILES: [(&str, &str, &str); 12] = [
    ("", "text/html; charset=utf-8", include_str!("page/index.html")),
    ("app.js", "text/javascript; charset=utf-8", include_str!("page/app.js")),
    ("project.js", "text/javascript; charset=utf-8", include_str!("page/project.js")),
    ("requests.js", "text/javascript; charset=utf-8", include_str!("page/requests.js")),
    ("predict.js", "text/javascript; charset=utf-8", include_str!("page/predict.js")),
    ("posterior.js", "text/javascript; charset=utf-8", include_str!("page/posterior.js")),
    ("plots.js", "text/javascript; charset=utf-8", include_str!("page/plots.js")),
    ("style.css", "text/css; charset=utf-8", include_str!("page/style.css")),
    ("glossary.md", "text/markdown; charset=utf-8", include_str!("../../../../docs/glossary.md")),
    ("report.css", "text/css; charset=utf-8", vitreo_uq::figures::page::STYLE),
    ("uPlot.js", "text/javascript; charset=utf-8", include_str!("page/vendor/uPlot.iife.min.js")),
    ("uPlot.css", "text/css; charset=utf-8", include_str!("page/vendor/uPlot.min.css")),
];

struct Bench {
    home: WorkbenchFolder,
    jobs: Arc<Jobs>,
    records: FileCache<CheckedRecord>,
    predictions: FileCache<Predictions>,
    trials: FileCache<Trial>,
    foresights: FileCache<Foresight>,
    news: watch::Sender<u64>,
    /// Hash of the folder's state, with the number of the event for which it was computed; `None` before the first event.
    folder: tokio::sync::Mutex<Option<(u64, String)>>,
    uploads: AtomicU64,
}

type SharedBench = Arc<Bench>;

/// Serves the page and its requests until the program ends.
pub fn run(listener: TcpListener, home: WorkbenchFolder, token: String, names: Guard) -> Result<()> {
    let refused = |error| Error::at_path("serve", home.dir(), error, "start the workbench again");
    tables::remove_old_uploads(&home);
    let news = watch::Sender::new(0);
    let jobs = Jobs::new(home.clone(), news.clone())?;
    let bench = Arc::new(Bench {
        home: home.clone(),
        jobs,
        records: FileCache::default(),
        predictions: FileCache::default(),
        trials: FileCache::default(),
        foresights: FileCache::default(),
        news,
        folder: tokio::sync::Mutex::default(),
        uploads: AtomicU64::new(0),
    });
    let app = move || {
        tokio::spawn(watch_folder(Arc::clone(&bench)));
        router(bench, &token, names)
    };
    http::serve(listener, app).map_err(refused)
}

fn router(bench: SharedBench, token: &str, names: Guard) -> Router {
    let at = |path: &str| format!("/{token}/{path}");
    let job: MethodRouter<SharedBench> = post(start).delete(stop).layer(middleware::from_fn(http::whole_body));
    let job = job.layer(DefaultBodyLimit::max(LARGEST_JOB));
    let mut router = Router::new()
        .route(&at("api/items"), get(items))
        .route(&at("api/records"), get(records))
        .route(&at("api/description"), get(description))
        .route(&at("api/record"), post(change_record))
        .route(&at("api/archive"), get(archive))
        .route(&at("api/study"), get(study))
        .route(&at("api/rows"), get(rows))
        .route(&at("api/corner"), get(corner_plot))
        .route(&at("api/knobs"), post(knobs))
        .route(&at("api/try"), post(try_model))
        .route(&at("api/foresight"), get(foresight))
        .route(&at("api/predict"), post(predict))
        .route(&at("api/init"), post(init))
        .route(&at("api/choice"), post(choice))
        .route(&at("api/events"), get(events))
        .route(&at("file"), get(file))
        .layer(middleware::from_fn(http::whole_body))
        .layer(DefaultBodyLimit::max(MOST_BYTES))
        .route(&at("api/job"), job)
        .route(&at("api/table"), post(table));
    for (name, kind, text) in FILES {
        router = router.route(&at(name), get(move || async move { ([(header::CONTENT_TYPE, kind)], text) }));
    }
    let nothing = || async {
        (StatusCode::NOT_FOUND, "This page does not exist. Open the link that `vitreo-uq workbench` printed.\n")
    };
    router.fallback(nothing).layer(middleware::from_fn_with_state(names, guard)).with_state(bench)
}

/// Checks for changes to the folder by other programs, as long as a page listens.
async fn watch_folder(bench: SharedBench) {
    let mut before = 0;
    loop {
        tokio::time::sleep(LOOK).await;
        if bench.news.receiver_count() == 0 {
            continue;
        }
        let entry = Arc::clone(&bench);
        let Ok(now) = tokio::task::spawn_blocking(move || entry.home.content_hash()).await else { continue };
        if now != before {
            before = now;
            bench.news.send_modify(|number| *number += 1);
        }
    }
}

/// Runs slow work on a separate thread. The response contains the resulting document, or an error message.
async fn answer<T: Serialize + Send + 'static>(work: impl FnOnce() -> Result<T> + Send + 'static) -> Response {
    let refused = |status: StatusCode, words: &str| http::json_body(status, &json!({ "error": words }));
    let written = move || match work() {
        Ok(document) => http::json_body(StatusCode::OK, &document),
        Err(error) => refused(StatusCode::UNPROCESSABLE_ENTITY, &error.to_string()),
    };
    tokio::task::spawn_blocking(written).await.unwrap_or_else(|_| {
        refused(StatusCode::INTERNAL_SERVER_ERROR, "this request failed inside the workbench; the reason is in its log")
    })
}

/// Query of a request: name of the item, and name of the revision to show.
#[derive(Deserialize)]
struct ItemQuery {
    item: String,
    revision: Option<String>,
}

async fn items(State(bench): State<SharedBench>) -> Response {
    answer(move || Ok(json!({ "home": bench.home.dir().display().to_string(), "items": bench.home.items() }))).await
}

async fn records(State(bench): State<SharedBench>) -> Response {
    answer(move || Ok(project::rows(&bench.home, |item| bench.is_current(item)))).await
}

async fn description(State(bench): State<SharedBench>, Query(named): Query<ItemQuery>) -> Response {
    answer(move || Ok(json!({ "text": project::description(&bench.home, &bench.home.find(&named.item)?)? }))).await
}

async fn change_record(State(bench): State<SharedBench>, Json(change): Json<RecordChange>) -> Response {
    answer(move || {
        bench.jobs.refuse_running("a record")?;
        let changed = project::change(&bench.home, &change)?;
        bench.news.send_modify(|number| *number += 1);
        Ok(changed)
    })
    .await
}

async fn archive(State(bench): State<SharedBench>, Query(named): Query<ItemQuery>) -> Response {
    let made = move || project::archive(&bench.home, &bench.home.find(&named.item)?);
    match tokio::task::spawn_blocking(made).await {
        Ok(Ok(bytes)) => ([(header::CONTENT_TYPE, "application/zip")], bytes).into_response(),
        Ok(Err(error)) => (StatusCode::UNPROCESSABLE_ENTITY, error.to_string()).into_response(),
        Err(_) => StatusCode::INTERNAL_SERVER_ERROR.into_response(),
    }
}

async fn study(State(bench): State<SharedBench>, Query(named): Query<ItemQuery>) -> Response {
    answer(move || study_of(&bench, &named.item, named.revision)).await
}

impl Bench {
    /// Returns the record of an item: that of its experiment, or without an experiment that of its study.
    fn record(&self, item: &Item) -> Result<Arc<CheckedRecord>> {
        let inside = item.experiment.as_ref().unwrap_or(&item.study);
        read_record(&self.records, &self.home.dir().join(inside))
    }

    /// Finds an item by its name. Also returns true if the item's study was made from another record than that of its experiment. The item then has no
    /// revisions, because they do not describe the record of the experiment.
    fn find_current_item(&self, name: &str) -> Result<(Item, bool)> {
        let mut item = self.home.find(name)?;
        let is_other = !self.is_current(&item);
        if is_other {
            item.revisions.clear();
        }
        Ok((item, is_other))
    }

    /// Returns false if an item's study was made from another record than that of its experiment. Comments and the order of keys change the files, but not the
    /// record.
    fn is_current(&self, item: &Item) -> bool {
        // Commands report a damaged study; nothing replaces it unasked.
        let (Some(experiment), Ok(study)) = (&item.experiment, Study::open(&self.home.dir().join(&item.study))) else {
            return true;
        };
        let is_same_file = |(name, sha256): (&String, &String)| {
            let bytes = files::read_if_there(&self.home.dir().join(experiment).join(name), Content::Table);
            bytes.is_some_and(|bytes| sha256_hex(&bytes) == *sha256)
        };
        // Equal files need not be parsed, which takes long for a folder of hundreds of records. A study without models counts as outdated if any file differs.
        study.inputs_sha256().iter().all(is_same_file)
            || !item.revisions.is_empty()
                && self
                    .record(item)
                    .is_ok_and(|now| study.read_experiment().is_ok_and(|(before, _)| before == now.experiment))
    }
}

async fn choice(State(bench): State<SharedBench>, Json(choice): Json<RowChoice>) -> Response {
    answer(move || {
        let item = bench.home.find(&choice.item)?;
        let Some(experiment) = &item.experiment else {
            return Err(Error::input(
                InputPlace::file(&item.study),
                "this study has no experiment in the folder, so its record cannot be changed",
                "open the experiment that the study was made from",
            ));
        };
        apply_choice(&bench.home.dir().join(experiment), &choice)?;
        bench.news.send_modify(|number| *number += 1);
        Ok(json!({}))
    })
    .await
}

/// All documents of an item, and the parts of its report as HTML.
fn study_of(bench: &Bench, name: &str, revision: Option<String>) -> Result<Value> {
    let (item, is_changed) = bench.find_current_item(name)?;
    if !item.figures.is_empty() {
        return Ok(json!({ "item": item }));
    }
    let dir = bench.home.dir().join(&item.study);
    let read = bench.record(&item)?;
    let experiment = &read.experiment;
    let mut revisions = Vec::new();
    for name in &item.revisions {
        let mut documents = Map::from_iter([("name".to_string(), json!(name))]);
        for (key, file) in [
            ("posterior", POSTERIOR_NAME),
            ("comparison", FINDINGS_NAME),
            ("diagnosis", DIAGNOSIS_NAME),
            ("learned", LEARNED_NAME),
            ("extension", EXTENSION_NAME),
        ] {
            documents.insert(key.into(), document(&dir.join(name).join(file)));
        }
        revisions.push(Value::Object(documents));
    }
    let asked = revision.filter(|name| item.revisions.contains(name));
    let parts = match asked.or_else(|| item.revisions.last().cloned()) {
        Some(name) => pages::parts(&dir, &name)?,
        None => Vec::new(),
    };
    let words = |value: Value| match experiment.quantities() {
        Some(quantities) => quantities.translate_sentences(value),
        None => value,
    };
    Ok(json!({
        "is_changed": is_changed,
        "record": words(serde_json::to_value(&read.summary).unwrap_or(Value::Null)),
        "axes": words(json!(["position (µm)", "residual (µm)", "force (µN)", "µm"])),
        "left_out_s": left_out_s(bench, &item),
        "noise_um": experiment.reference_noise().map(|yardstick| 1e6 * yardstick.sd_m),
        "cycles": cycles(experiment),
        "revisions": revisions,
        "ladder": if item.revisions.is_empty() { Value::Null } else { document(&dir.join(LADDER_NAME)) },
        "item": item,
        "parts": parts.into_iter().collect::<std::collections::BTreeMap<_, _>>(),
    }))
}

/// Time ranges that an experiment's description excludes, as they are written there.
fn left_out_s(bench: &Bench, item: &Item) -> Value {
    let read = || -> Option<Value> {
        let path = bench.home.dir().join(item.experiment.as_ref()?).join("experiment.toml");
        let bytes = files::read_if_there(&path, Content::Settings)?;
        let table: toml::Table = toml::from_str(std::str::from_utf8(&bytes).ok()?).ok()?;
        serde_json::to_value(table.get("measurement")?.get("left_out_s")?).ok()
    };
    read().unwrap_or_else(|| json!([]))
}

/// Start, end and use of each cycle, as JSON.
fn cycles(experiment: &Experiment) -> Vec<Value> {
    let shown = |CycleSpan { cycle, start_s, end_s, kind }| {
        let serves = match kind {
            CycleKind::Calibration => "fitted",
            CycleKind::HeldOut => "held out",
            CycleKind::Unused => "unused",
        };
        json!({ "cycle": cycle, "from_s": start_s, "to_s": end_s, "serves": serves })
    };
    artefacts::cycle_spans(experiment).into_iter().map(shown).collect()
}

/// Content of a JSON document; null if the file does not exist.
fn document(path: &std::path::Path) -> Value {
    let bytes = files::read_if_there(path, Content::Document);
    let mut document: Value = bytes.and_then(|bytes| serde_json::from_slice(&bytes).ok()).unwrap_or(Value::Null);
    // The page reads the keys of a creep record's document, so it gets the original keys. The sentences name the quantities of the record.
    match (document.get("record_kind").and_then(Value::as_str).and_then(Quantities::named), document.get_mut(ORIGINAL))
    {
        (Some(quantities), Some(original)) => quantities.translate_sentences(original.take()),
        _ => document,
    }
}

#[derive(Deserialize)]
struct AskedRows {
    item: String,
    revision: Option<String>,
    /// Revision that is compared with the first.
    compared: Option<String>,
    #[serde(flatten)]
    window: WindowOfQuery,
}

/// Query of a request for a time range. Numbers are given as text.
#[derive(Deserialize)]
struct WindowOfQuery {
    from_s: Option<String>,
    to_s: Option<String>,
    points: Option<String>,
    is_logarithmic: Option<String>,
}

impl WindowOfQuery {
    fn window(&self) -> Window {
        fn number<T: std::str::FromStr>(text: Option<&String>) -> Option<T> {
            text.and_then(|text| text.parse().ok())
        }
        Window {
            from_s: number(self.from_s.as_ref()),
            to_s: number(self.to_s.as_ref()),
            points: number(self.points.as_ref()),
            is_logarithmic: self.is_logarithmic.as_deref() == Some("true"),
        }
    }
}

async fn rows(State(bench): State<SharedBench>, Query(asked): Query<AskedRows>) -> Response {
    answer(move || {
        let (item, _) = bench.find_current_item(&asked.item)?;
        let read = bench.record(&item)?;
        let predictions = bench.predictions(&item, asked.revision.as_ref())?;
        let compared = bench.predictions(&item, asked.compared.as_ref())?;
        Ok(select_rows(&read.experiment, predictions.as_deref(), compared.as_deref(), asked.window.window()))
    })
    .await
}

#[derive(Deserialize)]
struct AskedCorner {
    item: String,
    /// Names of revisions, separated by commas.
    revisions: String,
    /// Names of parameters, separated by commas.
    parameters: String,
}

async fn corner_plot(State(bench): State<SharedBench>, Query(asked): Query<AskedCorner>) -> Response {
    answer(move || {
        let (item, _) = bench.find_current_item(&asked.item)?;
        let names =
            |text: &str| text.split(',').filter(|name| !name.is_empty()).map(String::from).collect::<Vec<String>>();
        let mut revisions = names(&asked.revisions);
        revisions.retain(|name| item.revisions.contains(name));
        let study = bench.home.dir().join(&item.study);
        let figure = corner::of_revisions(&study, &revisions, &names(&asked.parameters), &item.name)?;
        Ok(json!({ "svg": figure.document() }))
    })
    .await
}

async fn knobs(State(bench): State<SharedBench>, Json(tried): Json<TrialRequest>) -> Response {
    answer(move || {
        let trial = bench.trial(&tried)?;
        serde_json::to_value(trial.knobs())
            .map_err(|error| Error::numerical(error.to_string(), "report the parameters that were tried"))
    })
    .await
}

async fn try_model(State(bench): State<SharedBench>, Json(tried): Json<TrialRequest>) -> Response {
    answer(move || {
        let predictions = bench.predictions(&bench.home.find(&tried.item)?, Some(&tried.revision))?;
        bench.trial(&tried)?.curve(&tried, predictions.as_deref())
    })
    .await
}

#[derive(Deserialize)]
struct AskedForesight {
    item: String,
    revision: String,
}

#[derive(Deserialize)]
struct AskedPrediction {
    #[serde(flatten)]
    of: AskedForesight,
    #[serde(flatten)]
    request: ForesightRequest,
}

/// Ranges of the sliders of a prediction; `null` for records and models that cannot be predicted.
async fn foresight(State(bench): State<SharedBench>, Query(asked): Query<AskedForesight>) -> Response {
    answer(move || Ok(bench.foresight(&asked).ok().map(|foresight| foresight.limits().clone()))).await
}

async fn predict(State(bench): State<SharedBench>, Json(asked): Json<AskedPrediction>) -> Response {
    answer(move || bench.foresight(&asked.of)?.predicted(&asked.request)).await
}

impl Bench {
    /// The prepared prediction of a revision. It is prepared once and then cached.
    fn foresight(&self, asked: &AskedForesight) -> Result<Arc<Foresight>> {
        let study = self.home.dir().join(&self.home.find(&asked.item)?.study);
        let revision = study.join(&asked.revision);
        self.foresights.get(&revision, &[revision.join(POSTERIOR_NAME)], || {
            Foresight::open(&Study::open(&study)?, &asked.revision)
        })
    }

    /// Refuses a fit that would replace models of another record. This happens if another record has the same specimen id, and therefore the same study.
    fn refuse_shared(&self, item: &Item, is_changed: bool) -> Result<()> {
        if is_changed && self.home.shares_study(item) {
            let found = "another record has the same specimen id, and a fit would replace its models";
            let remedy = "give the record an `id` of its own in its description";
            return Err(Error::input(InputPlace::file(&item.name), found, remedy));
        }
        Ok(())
    }

    /// Predictions of a revision; `None` if the item has no such revision, or the revision no predictions.
    fn predictions(&self, item: &Item, revision: Option<&String>) -> Result<Option<Arc<Predictions>>> {
        match revision.filter(|name| item.revisions.contains(name)) {
            Some(name) => read_revision(&self.predictions, &self.home.dir().join(&item.study).join(name)),
            None => Ok(None),
        }
    }

    fn trial(&self, tried: &TrialRequest) -> Result<Arc<Trial>> {
        let item = self.home.find(&tried.item)?;
        trial(&self.trials, &self.home.dir().join(&item.study), tried)
    }
}

#[derive(Deserialize)]
struct Upload {
    name: String,
}

async fn table(
    State(bench): State<SharedBench>,
    Extension(connection): Extension<Connection>,
    Query(upload): Query<Upload>,
    body: Body,
) -> Response {
    // This time limit is longer than that of the upload. A slow upload can then be answered with an error message.
    connection.give_time(2 * UPLOAD);
    let refused = |words: &str| (StatusCode::UNPROCESSABLE_ENTITY, Json(json!({ "error": words }))).into_response();
    let too_large =
        "the table is larger than 256 MiB; run `vitreo-uq init TABLE` in a terminal, which reads up to 1 GiB";
    // The length that a request announces is refused before any byte is read.
    if body.size_hint().lower() > LARGEST_UPLOAD as u64 {
        return refused(too_large);
    }
    let bytes = match tokio::time::timeout(UPLOAD, to_bytes(body, LARGEST_UPLOAD)).await {
        Ok(Ok(bytes)) => bytes,
        Ok(Err(_)) => return refused(&format!("the table did not arrive completely, or {too_large}")),
        Err(_) => return refused("the table did not arrive within two minutes"),
    };
    connection.mark_request_complete();
    let number = bench.uploads.fetch_add(1, Ordering::Relaxed);
    answer(move || Ok(json!({ "upload": tables::store_upload(&bench.home, &upload.name, number, &bytes)? }))).await
}

async fn init(State(bench): State<SharedBench>, Json(described): Json<Described>) -> Response {
    answer(move || tables::describe(&bench.home, &described)).await
}

async fn start(State(bench): State<SharedBench>, Json(wish): Json<JobRequest>) -> Response {
    answer(move || {
        let (item, is_changed) = match wish.kind {
            JobKind::Groups => (bench.home.groups(&wish.with), false),
            JobKind::Example => (bench.home.example(), false),
            JobKind::SampleMany | JobKind::DiagnoseMany => {
                let mut items = Vec::new();
                for item in bench.home.items().into_iter().filter(|item| wish.with.contains(&item.name)) {
                    let is_changed = !bench.is_current(&item);
                    bench.refuse_shared(&item, is_changed)?;
                    items.push((item, is_changed));
                }
                return bench.jobs.start_many(wish.kind, &items);
            }
            _ => bench.find_current_item(&wish.item)?,
        };
        bench.refuse_shared(&item, is_changed)?;
        bench.jobs.start(&wish, &item, is_changed)
    })
    .await
}

async fn stop(State(bench): State<SharedBench>) -> Response {
    answer(move || {
        bench.jobs.stop();
        Ok(json!({}))
    })
    .await
}

/// Stream of events to the page: the current job, and a hash that changes with the folder.
async fn events(State(bench): State<SharedBench>, Extension(connection): Extension<Connection>) -> impl IntoResponse {
    connection.mark_as_stream();
    let mut news = bench.news.subscribe();
    // The present state comes first, without waiting for a change.
    news.mark_changed();
    let events = stream::unfold((news, bench), |(mut news, bench)| async move {
        news.changed().await.ok()?;
        let number = *news.borrow_and_update();
        let event = json!({ "state": bench.state_at(number).await, "job": bench.jobs.present() });
        Some((Ok::<Event, std::convert::Infallible>(Event::default().data(event.to_string())), (news, bench)))
    });
    Sse::new(events).keep_alive(KeepAlive::default())
}

impl Bench {
    /// Hash of the folder's state for an event number. It is computed once for all open pages.
    async fn state_at(self: &Arc<Self>, number: u64) -> String {
        let mut known = self.folder.lock().await;
        if let Some((_, state)) = known.as_ref().filter(|(at, _)| *at >= number) {
            return state.clone();
        }
        let bench = Arc::clone(self);
        let state =
            tokio::task::spawn_blocking(move || bench.home.content_hash().to_string()).await.unwrap_or_default();
        *known = Some((number, state.clone()));
        state
    }
}

#[derive(Deserialize)]
struct AskedFile {
    item: String,
    path: String,
}

async fn file(State(bench): State<SharedBench>, Query(asked): Query<AskedFile>) -> Response {
    let read = move || {
        let path = bench.home.file(&bench.home.find(&asked.item)?, &asked.path)?;
        let bytes = files::read(&path, Content::Document, "make the study again")?;
        Ok((path, bytes))
    };
    match tokio::task::spawn_blocking(read).await {
        Ok(Ok((path, bytes))) => {
            let kind = match path.extension().and_then(|name| name.to_str()) {
                Some("svg") => "image/svg+xml",
                Some("png") => "image/png",
                Some("pdf") => "application/pdf",
                Some("html") => "text/html; charset=utf-8",
                Some("json") => "application/json",
                Some("csv") => "text/csv; charset=utf-8",
                Some("toml") => "text/plain; charset=utf-8",
                _ => "application/octet-stream",
            };
            ([(header::CONTENT_TYPE, kind), (header::CONTENT_SECURITY_POLICY, FILE_POLICY)], bytes).into_response()
        }
        Ok(Err(Error::Input { .. })) => StatusCode::NOT_FOUND.into_response(),
        _ => StatusCode::INTERNAL_SERVER_ERROR.into_response(),
    }
}
