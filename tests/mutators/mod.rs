//! Hard input: damaged, edited and made-up files, and all readers for them.
//!
//! The test suite runs it for seconds, the campaign `campaigns/hard-input` for hours. Both use damage ([`input`]) and valid files with other values and spellings ([`variant`]).
#![allow(dead_code, reason = "the test and the campaign each use their own part")]

mod grammar;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, OnceLock};
use std::time::Duration;

use vitreo_uq::base::sha256::{Hash, sha256_hex};

use grammar::Grammar;
use vitreo_uq::Result;
use vitreo_uq::base::error::{self, Error};
use vitreo_uq::base::toml_input::text_of;
use vitreo_uq::documents::ladder::LadderSummary;
use vitreo_uq::elements::mesh::gmsh::read_gmsh;
use vitreo_uq::figures;
use vitreo_uq::figures::corner::{CornerOptions, ParameterColumn, Posterior, corner};
use vitreo_uq::figures::density::{estimate_support, sorted};
use vitreo_uq::figures::draws::read_draws_csv;
use vitreo_uq::figures::palette::series;
use vitreo_uq::jobs::bridge::{BridgeModels, Endpoint};
use vitreo_uq::jobs::tasks::commands;
use vitreo_uq::jobs::tasks::list::List;
use vitreo_uq::laws::rheology::Network;
use vitreo_uq::models::effects::Library;
use vitreo_uq::models::surrogate::{ReducedOperators, Surrogate};
use vitreo_uq::posterior::mechanics::Mechanics;
use vitreo_uq::posterior::monitor::SilentMonitor;
use vitreo_uq::posterior::prepared::{KeptSurrogate, PreparedModel};
use vitreo_uq::posterior::prior::PriorSet;
use vitreo_uq::posterior::problem::Problem;
use vitreo_uq::posterior::replica;
use vitreo_uq::posterior::study::{Kept, ModelSpecification, Study, WithProvenance, effect_file};
use vitreo_uq::record::Experiment;
use vitreo_uq::record::table::{TableSettings, propose};
use vitreo_uq::sampling::ensemble::{Checkpointing, Progress, RunControl};
use vitreo_uq::sampling::{LogDensity, SamplerOptions, sample};
use vitreo_uq::validation::challenge::files::open_challenge;

/// Random numbers by a fixed recurrence (xorshift64*), equal on every machine.
pub struct Dice(u64);

impl Dice {
    pub fn new(seed: u64) -> Self {
        let mut dice = Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1);
        for _ in 0..8 {
            dice.word();
        }
        dice
    }

    fn word(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_f491_4f6c_dd1d)
    }

    /// A whole number below `n`, which must be above 0.
    pub fn below(&mut self, n: usize) -> usize {
        usize::try_from(self.word() % n as u64).unwrap_or(0)
    }
}

/// Replacements for a number.
const NUMBERS: [&str; 30] = [
    "0",
    "-0.0",
    "1",
    "-1",
    "2",
    "1e-320",
    "5e-324",
    "1e-30",
    "1e-9",
    "0.5",
    "1e9",
    "1e15",
    "1e19",
    "1e100",
    "1e308",
    "-1e308",
    "1e999",
    "nan",
    "inf",
    "-inf",
    "4294967295",
    "4294967296",
    "9223372036854775807",
    "9223372036854775808",
    "18446744073709551616",
    "0x10",
    "1_000",
    "",
    "\"7\"",
    "null",
];
/// Tokens for insertion anywhere.
const TOKENS: [&str; 24] = [
    "[",
    "]",
    "{",
    "}",
    "\"",
    "'",
    ",",
    ";",
    "\n",
    "\r\n",
    "\t",
    "\0",
    "=",
    "[[",
    "#",
    "é",
    "\u{feff}",
    "\u{202e}",
    "𝛂",
    "true",
    "[robot]",
    "[base.network]",
    "series = [",
    "$EndNodes\n",
];

/// One mutation of a file.
pub fn mutate(bytes: &mut Vec<u8>, other: &[u8], dice: &mut Dice) {
    match dice.below(14) {
        0 if !bytes.is_empty() => {
            let at = dice.below(bytes.len());
            bytes[at] ^= 1 << dice.below(8);
        }
        1 if !bytes.is_empty() => {
            let at = dice.below(bytes.len());
            bytes[at] = dice.below(256) as u8;
        }
        2 => bytes.truncate(dice.below(bytes.len() + 1)),
        3 => {
            let [start, end] = range(bytes.len(), dice);
            bytes.drain(start..end);
        }
        4 => {
            let [start, end] = range(bytes.len(), dice);
            let part = bytes[start..end].to_vec();
            let at = dice.below(bytes.len() + 1);
            drop(bytes.splice(at..at, part));
        }
        5 => insert(bytes, TOKENS[dice.below(TOKENS.len())].as_bytes(), dice),
        6 => insert(bytes, NUMBERS[dice.below(NUMBERS.len())].as_bytes(), dice),
        7..=9 => replace_number(bytes, dice),
        10 => with_lines(bytes, dice, |lines, dice| drop(lines.remove(dice.below(lines.len())))),
        11 => with_lines(bytes, dice, |lines, dice| {
            let (a, b) = (dice.below(lines.len()), dice.below(lines.len()));
            lines.swap(a, b);
        }),
        12 => with_lines(bytes, dice, |lines, dice| {
            let (at, times) = (dice.below(lines.len()), [1, 2, 50, 2_000][dice.below(4)]);
            let line = lines[at].clone();
            drop(lines.splice(at..at, std::iter::repeat_n(line, times)));
        }),
        _ => {
            let [start, end] = range(other.len(), dice);
            let part = other[start..end].to_vec();
            insert(bytes, &part, dice);
        }
    }
}

fn range(length: usize, dice: &mut Dice) -> [usize; 2] {
    let start = dice.below(length + 1);
    let most = [4, 40, 400, length][dice.below(4)];
    [start, (start + dice.below(most + 1)).min(length)]
}

fn insert(bytes: &mut Vec<u8>, part: &[u8], dice: &mut Dice) {
    let at = dice.below(bytes.len() + 1);
    drop(bytes.splice(at..at, part.iter().copied()));
}

fn replace_number(bytes: &mut Vec<u8>, dice: &mut Dice) {
    let is_part = |byte: &u8| byte.is_ascii_digit() || matches!(byte, b'.' | b'-' | b'+' | b'e' | b'E');
    let is_start = |at: usize| bytes[at].is_ascii_digit() && (at == 0 || !is_part(&bytes[at - 1]));
    let starts: Vec<usize> = (0..bytes.len()).filter(|at| is_start(*at)).collect();
    if starts.is_empty() {
        return;
    }
    let start = starts[dice.below(starts.len())];
    let length = bytes[start..].iter().take_while(|byte| is_part(byte)).count();
    let new = NUMBERS[dice.below(NUMBERS.len())].as_bytes();
    drop(bytes.splice(start..start + length, new.iter().copied()));
}

fn with_lines(bytes: &mut Vec<u8>, dice: &mut Dice, change: impl FnOnce(&mut Vec<Vec<u8>>, &mut Dice)) {
    let mut lines: Vec<Vec<u8>> = bytes.split_inclusive(|byte| *byte == b'\n').map(<[u8]>::to_vec).collect();
    if !lines.is_empty() {
        change(&mut lines, dice);
        *bytes = lines.concat();
    }
}

/// A reader with files that it accepts.
pub struct Reader {
    pub name: &'static str,
    /// Grammar; only for files that people and other programs write.
    pub grammar: Option<Grammar>,
    pub samples: Vec<Vec<u8>>,
    read: fn(&Place, &[u8]) -> Result<()>,
}

/// Folder in which readers of files find them.
pub struct Place {
    folder: PathBuf,
}

impl Place {
    /// Uses an existing, empty folder.
    pub fn new(folder: &Path) -> Self {
        Self { folder: folder.to_path_buf() }
    }

    fn put(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.folder.join(name);
        std::fs::write(&path, bytes).expect("the scratch folder can be written");
        path
    }
}

/// Outcome of an input.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    Accepted,
    /// Refused with exit code 2 and a remedy.
    Refused,
    /// Read, but the computation failed with an error.
    Failed,
    Panicked,
}

impl Reader {
    /// Gives the reader an input.
    pub fn play(&self, place: &Place, bytes: &[u8]) -> Outcome {
        match catch_unwind(AssertUnwindSafe(|| (self.read)(place, bytes))) {
            Ok(Ok(())) => Outcome::Accepted,
            Ok(Err(error)) if error.exit_code() == 2 && error.to_string().contains("what to do: ") => Outcome::Refused,
            Ok(Err(_)) => Outcome::Failed,
            Err(_) => Outcome::Panicked,
        }
    }
}

/// The mutated input with a number: one to four mutations of one of the reader's samples.
pub fn input(reader: &Reader, seed: u64, number: u64) -> Vec<u8> {
    let mut dice = Dice::new(seed.wrapping_add(number.wrapping_mul(0x1_0000_0001)));
    let samples = &reader.samples;
    let mut bytes = samples[dice.below(samples.len())].clone();
    let other = &samples[dice.below(samples.len())];
    for _ in 0..1 + dice.below(4) {
        mutate(&mut bytes, other, &mut dice);
    }
    bytes
}

/// The valid variant with a number of one of the reader's samples; `None` for a reader without a grammar.
pub fn variant(reader: &Reader, seed: u64, number: u64) -> Option<Vec<u8>> {
    let mut dice = Dice::new(seed.wrapping_add(number.wrapping_mul(0x1_0000_0001)));
    let sample = &reader.samples[dice.below(reader.samples.len())];
    Some(grammar::variant(reader.grammar?, sample, &mut dice))
}

const SMALL_TOML: &str = "[specimen]\nid = \"gel\"\n[instrument]\ncompliance_per_m = 549.0\n[measurement]\nfile = \"trajectory.csv\"\ncalibration_cycles = [1]\nheldout_cycles = [2]\nnoise_um = 0.5\nsource = \"synthetic: a line\"\n";
const ROBOT_TOML: &str = "[specimen]\nid = \"eye\"\nspecies = \"porcine\"\n[robot]\nshape = \"cylinder\"\nlength_mm = 1.8\ndiameter_mm = 0.28\norientation = \"horizontal\"\ndensity_kg_m3 = 7500\noffset_mm = 0.5\noffset_direction = \"along\"\n[vitreous]\ndiameter_mm = 20.0\npoisson_ratio = 0.48\ndensity_kg_m3 = 1000\n[measurement]\nfile = \"trajectory.csv\"\n";
const NETWORK: &str =
    "series = [\n  { parallel = [{ spring = \"e\" }, { springpot = \"p\" }] },\n  { dashpot = \"c\" },\n]\n";
const MODEL: &str = "base = \"lethersich\"\neffects = [\"clock-offset\", \"tracking-drift\"]\nnoise = [\"white\", \"gain\"]\nprior = \"generic\"\n[fixed]\nyoung_modulus_pa = 3.5\n";
const NETWORK_MODEL: &str = "effects = []\nnoise = [\"white\"]\nprior = \"generic\"\n[base.network]\nseries = [\n  { parallel = [{ spring = \"e\" }, { springpot = \"p\" }] },\n  { dashpot = \"c\" },\n]\n";

const EFFECT: &str = "name = \"hardening\"\nquantity = \"young_modulus_pa\"\nstate = \"path\"\nfactor = \"exp(rate * path)\"\nsummary = \"harder\"\n[parameters.rate]\nunit = \"1/m\"\nnull = 0.0\nprior = { distribution = \"normal\", mean = 0.0, sd = 1000.0 }\n";
const TABLE_EFFECT: &str = "name = \"fading\"\nquantity = \"force\"\nstate = \"time\"\ntable = { state = [0.0, 5.0, 20.0], factor = [1.0, 0.9, 0.75] }\n[parameters.strength]\nunit = \"1\"\nnull = 0.0\nlower = 0.0\nprior = { distribution = \"half_normal\", sd = 1.0 }\n";
const COMMANDS: &str = "sample eyes/a --steps 3000 --seed 7 --out {out}\ndiagnose eyes/a --out {out} --simulations 40\nfit eyes/b --set young_modulus_pa=3.5 --out {out}/fit --quiet\n";
const REQUESTS: [&str; 4] = [
    "Evaluate {\"name\": \"trajectory\", \"input\": [[3.3, 1.5, 44.0]], \"config\": {\"model\": \"reduced\"}}",
    "Evaluate {\"name\": \"posterior\", \"input\": [[3.3, 1.5, 44.0, 0.7, 3.4, 1.4, 45.0, 0.6]], \"config\": {\"points\": 2}}",
    "Gradient {\"name\": \"posterior\", \"input\": [[3.3, 1.5, 44.0, 0.7]], \"outWrt\": 0, \"inWrt\": 0, \"sens\": [1.0], \"config\": {}}",
    "ApplyJacobian {\"name\": \"trajectory\", \"input\": [[3.3, 1.5, 44.0]], \"outWrt\": 0, \"inWrt\": 0, \"vec\": [0.1, 0.2, -0.3]}",
];

/// Three tasks, one per line. `read_tasks` writes their ids.
fn task_lines() -> String {
    let line = |k: usize| {
        serde_json::json!({ "task": k, "id": "", "result": "", "command": ["vitreo-uq", "tasks", "run", "list", "--task", k.to_string()],
            "arguments": { "words": ["fit", "gel", "--out", "{out}"], "inputs": { "gel": sha256_hex(&[k as u8]) }, "weight": 0.5 + k as f64 }, "paths": ["eyes/a"] })
    };
    (0..3).map(|k| line(k).to_string() + "\n").collect()
}

/// Forty rows of two cycles.
fn small_csv() -> String {
    let row = |k: usize| {
        let (time_s, force_un) = (0.1 * k as f64, if (k / 10).is_multiple_of(2) { 1.0 } else { -1.0 });
        format!("{time_s:.1},{force_un},{:.3},{}\n", time_s * force_un, 1 + k / 20)
    };
    "time_s,force_uN,position_um,cycle\n".to_string() + &(0..40).map(row).collect::<String>()
}

fn draws_csv() -> Vec<Vec<u8>> {
    let mut indexed = String::from("ensemble,walker,step,young_modulus_pa,viscosity_1_pa_s,log_density\n");
    let mut plain = String::from("a,b\n");
    for k in 0..64_usize {
        let (x, y) = (3.5 + 0.1 * (k as f64 * 0.7).sin(), 1.4 + 0.2 * (k as f64 * 1.3).cos());
        indexed += &format!("{},{},{},{x:?},{y:?},-1.5\n", k / 32, (k / 8) % 4, k % 8);
        plain += &format!("{x:?},{y:?}\n");
    }
    vec![indexed.into_bytes(), plain.into_bytes()]
}

/// A surrogate of one mode, in the format of `surrogate.json`.
pub fn surrogate_json() -> Vec<u8> {
    let range = |name: &str, lower, upper| vitreo_uq::models::model::TrainedRange { name: name.into(), lower, upper };
    let operators = ReducedOperators {
        n_modes: 1,
        deviatoric: vec![2.0],
        volumetric: vec![0.5],
        robot: vec![1.0],
        force_share: 0.25,
    };
    let surrogate = Surrogate {
        parameters: vec![range("young_modulus_pa", 0.1, 50.0)],
        poisson_ratio: range("poisson_ratio", 0.48, 0.48),
        operators,
        singular_values: vec![1.0, 1e-9],
        tolerance: 1e-6,
        snapshot_runs: 16,
        verification_runs: 8,
        max_projection_error: 1e-9,
        max_relative_error: 1e-9,
        fe_unknowns: 15_480,
    };
    let (built_from_sha256, fields_built_from_sha256) = ("00".repeat(32), "11".repeat(32));
    let body = KeptSurrogate { built_from_sha256, fields_built_from_sha256, fields: Default::default(), surrogate };
    let provenance = vitreo_uq::posterior::study::Provenance::new("surrogate", 1, 1, Default::default());
    serde_json::to_vec_pretty(&WithProvenance { provenance, body: Kept::new(body) }).expect("JSON")
}

fn ladder_json() -> Vec<u8> {
    let parameter = |median: f64| serde_json::json!({ "name": "young_modulus_pa", "mean": median, "sd": 0.1, "q05": 3.0, "median": median, "q95": 4.0 });
    let rung = |name: &str, effects: &[&str], rmse: f64| {
        serde_json::json!({ "revision": name, "effects": effects, "from": null, "added": effects,
            "model": { "base": "lethersich", "effects": effects, "noise": ["white"] },
            "rmse_fitted_um": rmse, "rmse_heldout_um": rmse, "heldout_log_score_nats": -10.0, "heldout_log_score_mcse_nats": 0.1,
            "parameters": [parameter(3.5)], "learnt_noise_um": 0.5, "coverage_50": 0.5, "coverage_90": 0.9, "joint_p": 0.5,
            "fe_runs": null, "surrogate_vs_fe_max_um": null, "converged": true, "warnings": [] })
    };
    let summary = serde_json::json!({ "schema": "vitreo-uq/ladder/1", "version": "0.1.0", "seed": 1, "inputs_sha256": {},
        "experiment": "gel", "fitted_cycles": [1], "heldout_cycles": [2], "noise_um": 0.5, "noise_origin": "known",
        "revisions": [rung("m0", &[], 5.0), rung("m1", &["clock-offset"], 0.6)],
        "shifts": [{ "name": "young_modulus_pa", "before": parameter(3.0), "after": parameter(3.5), "relative": 0.1, "in_sd_before": 2.0 }],
        "sentence": "It fell." });
    serde_json::to_vec_pretty(&summary).expect("JSON")
}

fn instrument(toml: &[u8], csv: &[u8]) -> Result<Experiment> {
    Ok(Experiment::from_texts("experiment.toml", toml, "trajectory.csv", csv)?.0)
}

/// Joins a model with an instrument's experiment and evaluates the posterior density at three points.
fn ask(experiment: Experiment, specification: ModelSpecification) -> Result<()> {
    let mechanics = Arc::new(Mechanics::Instrument { compliance_per_m: 549.0 });
    let problem = Problem::with_mechanics(experiment, specification, &Library::default(), mechanics)?;
    let prepared = PreparedModel::new(&problem, None, &SilentMonitor)?;
    let posterior = prepared.posterior();
    let medians: Vec<f64> = problem.priors.priors().iter().map(|prior| prior.distribution.quantile(0.5)).collect();
    let medians = problem.priors.to_unconstrained(&medians);
    for shift in [0.0, 0.5, -0.5] {
        let point: Vec<f64> = medians.iter().map(|z| z + shift).collect();
        posterior.log_density(&point, &mut [0.0]);
    }
    Ok(())
}

fn read_experiment(_: &Place, bytes: &[u8]) -> Result<()> {
    let experiment = instrument(bytes, small_csv().as_bytes())?;
    drop((experiment.reference_noise(), experiment.for_comparison()));
    Ok(())
}

fn read_trajectory(_: &Place, bytes: &[u8]) -> Result<()> {
    let experiment = instrument(SMALL_TOML.as_bytes(), bytes)?;
    drop((experiment.reference_noise(), experiment.for_comparison()));
    if experiment.record.n_rows() < 500 { ask(experiment, ModelSpecification::default()) } else { Ok(()) }
}

fn read_model(_: &Place, bytes: &[u8]) -> Result<()> {
    let specification = ModelSpecification::from_text(Path::new("model.toml"), bytes, &Library::default())?;
    ask(instrument(SMALL_TOML.as_bytes(), small_csv().as_bytes())?, specification)
}

fn read_network(_: &Place, bytes: &[u8]) -> Result<()> {
    Network::from_text(Path::new("network.toml"), &String::from_utf8_lossy(bytes)).map(drop)
}

fn read_prior(place: &Place, bytes: &[u8]) -> Result<()> {
    let path = place.put("prior.toml", bytes);
    let priors = PriorSet::read(&path.display().to_string())?;
    drop(priors.box_quantiles(1e-9));
    let prior = path.display().to_string();
    ask(instrument(SMALL_TOML.as_bytes(), small_csv().as_bytes())?, ModelSpecification { prior, ..Default::default() })
}

fn read_surrogate(place: &Place, bytes: &[u8]) -> Result<()> {
    place.put("surrogate.json", bytes);
    if let Some(kept) = KeptSurrogate::read(&place.folder, &SilentMonitor) {
        kept.surrogate.compliance_per_m(0.48)?;
    }
    Ok(())
}

fn read_draws(place: &Place, bytes: &[u8]) -> Result<()> {
    let table = read_draws_csv(&place.put("draws.csv", bytes))?;
    let columns: Vec<Vec<f64>> = (0..table.parameter_names.len()).map(|k| table.column(k)).collect();
    let parameters = table.parameter_names.iter().zip(&columns).map(|(name, draws)| ParameterColumn {
        name,
        symbol: name,
        unit: "Pa",
        draws,
        support: estimate_support(&sorted(draws)),
        prior: None,
        reference: None,
    });
    let posterior = Posterior { label: "draws", colour: series(0), parameters: parameters.collect() };
    corner(&[posterior], &CornerOptions::default())?.png().map(drop)
}

fn read_ladder(_: &Place, bytes: &[u8]) -> Result<()> {
    // As in the command, a file that is not a ladder is made again.
    let Ok(document) = serde_json::from_slice::<WithProvenance<LadderSummary>>(bytes) else { return Ok(()) };
    figures::ladder::ladder(&document.body)?.png().map(drop)
}

fn read_mesh(place: &Place, bytes: &[u8]) -> Result<()> {
    read_gmsh(place.put("mesh.msh", bytes), 1e-3).map(drop)
}

fn read_table(_: &Place, bytes: &[u8]) -> Result<()> {
    propose(Path::new("table.csv"), bytes, &TableSettings::default(), &mut |_| None).map(drop)
}

fn read_effect(_: &Place, bytes: &[u8]) -> Result<()> {
    let path = Path::new("effect.toml");
    effect_file::parsed(path, text_of(path, bytes)?).map(drop)
}

fn read_commands(place: &Place, bytes: &[u8]) -> Result<()> {
    commands::read(&place.put("commands.txt", bytes)).map(drop)
}

/// Reads a list whose head, numbers, ids and result names match these lines, as an attacker would write them.
fn read_tasks(place: &Place, bytes: &[u8]) -> Result<()> {
    let mut text = Vec::new();
    for (number, line) in bytes.split_inclusive(|byte| *byte == b'\n').enumerate() {
        match serde_json::from_slice::<serde_json::Value>(line) {
            Ok(mut task) if task["arguments"].is_object() => {
                let id = sha256_hex(format!("0.1.0\ncommands\n{}", task["arguments"]).as_bytes());
                let result = format!("results/{}.task", &id[..24]);
                (task["task"], task["id"], task["result"]) = (number.into(), id.into(), result.into());
                text.extend(format!("{task}\n").into_bytes());
            }
            _ => text.extend(line),
        }
    }
    place.put("tasks.jsonl", &text);
    let head = serde_json::json!({ "schema": "vitreo-uq/tasks/1", "version": "0.1.0", "seed": 1, "inputs_sha256": {}, "kind": "commands", "program": "0.1.0", "directory": "/",
        "tasks": text.iter().filter(|byte| **byte == b'\n').count(), "lines_sha256": sha256_hex(&text) });
    place.put("tasks.json", head.to_string().as_bytes());
    let list = List::open(&place.folder)?;
    (0..list.n_tasks()).try_for_each(|number| list.task(number).map(drop))
}

/// Reads a client's request to an endpoint, whose name precedes it.
fn read_request(_: &Place, bytes: &[u8]) -> Result<()> {
    static MODEL: OnceLock<PreparedModel> = OnceLock::new();
    let model = MODEL.get_or_init(|| {
        let experiment = instrument(SMALL_TOML.as_bytes(), small_csv().as_bytes()).expect("it is sound");
        let mechanics = Arc::new(Mechanics::Instrument { compliance_per_m: 549.0 });
        let problem =
            Problem::with_mechanics(experiment, ModelSpecification::default(), &Library::default(), mechanics);
        PreparedModel::new(&problem.expect("it is sound"), None, &SilentMonitor).expect("an instrument")
    });
    let end = bytes.iter().position(|byte| *byte == b' ').unwrap_or(bytes.len());
    let (path, body) = (format!("/{}", String::from_utf8_lossy(&bytes[..end])), &bytes[(end + 1).min(bytes.len())..]);
    let endpoint = Endpoint::ALL.into_iter().find(|endpoint| endpoint.path() == path).unwrap_or(Endpoint::Evaluate);
    let answer = BridgeModels::new(model)?.answer(endpoint, body);
    let words = answer.body.to_string();
    match answer.status {
        200 => Ok(()),
        400 => Err(Error::input(error::InputPlace::default(), words, "as the answer says")),
        _ => Err(Error::numerical(words, "as the answer says")),
    }
}

/// A normal density.
struct Bowl;

impl LogDensity for Bowl {
    fn dimension(&self) -> usize {
        2
    }
    fn log_density(&self, points: &[f64], log_density: &mut [f64]) {
        let (x, y) = points.split_at(log_density.len());
        log_density.iter_mut().zip(x.iter().zip(y)).for_each(|(out, (x, y))| *out = -0.5 * (x * x + y * y));
    }
}

/// A short run with the state that it saved. It stops at its first report if `stop` is given.
fn bowl(resume: Option<&[u8]>, stop: Option<&AtomicBool>) -> (Result<()>, Vec<u8>) {
    let saved = Mutex::new(Vec::new());
    let sink = |bytes: &[u8]| {
        *saved.lock().expect("nobody panics with it") = bytes.to_vec();
        Ok(())
    };
    let progress = |_: &Progress| {
        if let Some(stop) = stop {
            stop.store(true, Ordering::SeqCst);
        }
    };
    let control = RunControl {
        stop,
        progress: Some(&progress),
        checkpoint: Some(Checkpointing { sink: &sink, interval: Duration::from_secs(3600) }),
        resume,
        ..RunControl::default()
    };
    let options = SamplerOptions { n_walkers: 8, max_steps: 600, threads: 1, ..SamplerOptions::default() };
    let outcome = sample(&Bowl, &[vec![0.5, -0.5]], &options, &control).map(drop);
    (outcome, saved.into_inner().expect("nobody panics with it"))
}

/// A sampler's state without the hash at its end. [`read_checkpoint`] adds the hash, so edited states must be detected by their content.
fn checkpoint() -> Vec<u8> {
    let (_, mut bytes) = bowl(None, Some(&AtomicBool::new(false)));
    bytes.truncate(bytes.len() - 32);
    bytes
}

fn read_checkpoint(_: &Place, bytes: &[u8]) -> Result<()> {
    let sealed = [bytes, &Hash::hash(bytes)].concat();
    bowl(Some(&sealed), None).0
}

fn read_study(place: &Place, bytes: &[u8]) -> Result<()> {
    let (experiment, files) = replica::embedded()?;
    let dir = place.folder.join("study");
    if !dir.exists() {
        Study::open_or_create(&dir, &files, false)?;
    }
    std::fs::write(dir.join("inputs.sha256"), bytes).expect("the scratch folder can be written");
    drop(experiment);
    Study::open(&dir)?.revisions().map(drop)
}

fn read_challenge(place: &Place, bytes: &[u8]) -> Result<()> {
    place.put("commitment.sha256", b"00\n");
    place.put("experiment.toml", b"# Sealed answer, SHA-256: 00\n");
    place.put("trajectory.csv", small_csv().as_bytes());
    place.put("sealed.json", bytes);
    open_challenge(&place.folder).map(drop)
}

/// All readers. The accepted files are in `data/` and `tests/data/`, or made here.
pub fn readers() -> Vec<Reader> {
    let data =
        |name: &str| std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join(name)).expect("it is in the sources");
    let text = |text: &str| text.as_bytes().to_vec();
    let reader = |name, samples, read| Reader { name, grammar: None, samples, read };
    let of = |grammar, reader: Reader| Reader { grammar: Some(grammar), ..reader };
    vec![
        of(
            Grammar::Toml,
            reader(
                "experiment.toml",
                vec![text(SMALL_TOML), text(ROBOT_TOML)],
                read_experiment as fn(&Place, &[u8]) -> Result<()>,
            ),
        ),
        of(
            Grammar::OwnTable,
            reader(
                "trajectory.csv",
                vec![text(&small_csv()), text(&small_csv().replace("_um", "_nm"))],
                read_trajectory,
            ),
        ),
        of(Grammar::AnyTable, reader("table", vec![text(&small_csv())], read_table)),
        of(Grammar::Toml, reader("effect.toml", vec![text(EFFECT), text(TABLE_EFFECT)], read_effect)),
        of(Grammar::Commands, reader("commands", vec![text(COMMANDS)], read_commands)),
        of(Grammar::JsonLines, reader("tasks", vec![text(&task_lines())], read_tasks)),
        of(Grammar::Request, reader("request", REQUESTS.map(text).to_vec(), read_request)),
        reader("model.toml", vec![text(MODEL), text(NETWORK_MODEL)], read_model),
        reader("network", vec![text(NETWORK)], read_network),
        of(
            Grammar::Toml,
            reader("prior", vec![data("priors/generic.toml"), data("priors/nickerson-2008-bovine.toml")], read_prior),
        ),
        reader("surrogate.json", vec![surrogate_json()], read_surrogate),
        reader("draws.csv", draws_csv(), read_draws),
        reader("ladder.json", vec![ladder_json()], read_ladder),
        reader(
            "mesh",
            ["quarter_sphere_tet10.msh", "quarter_sphere_tet10_binary.msh", "quarter_sphere_tet4.msh"]
                .map(|name| data(&format!("tests/data/gmsh/{name}")))
                .to_vec(),
            read_mesh,
        ),
        of(
            Grammar::Mesh,
            reader(
                "ASCII mesh",
                ["quarter_sphere_tet10.msh", "quarter_sphere_tet4.msh"]
                    .map(|name| data(&format!("tests/data/gmsh/{name}")))
                    .to_vec(),
                read_mesh,
            ),
        ),
        reader("checkpoint", vec![checkpoint()], read_checkpoint),
        reader(
            "inputs.sha256",
            vec![text(&format!("{}  experiment.toml\n{}  trajectory.csv\n", "00".repeat(32), "11".repeat(32)))],
            read_study,
        ),
        reader(
            "sealed.json",
            vec![text("{\"salt_hex\": \"00\", \"sealed\": \"00ff\", \"commitment_sha256\": \"00\"}")],
            read_challenge,
        ),
    ]
}
