//! `challenge`: makes data with a sealed hidden effect, opens the seal, or plays many challenges.

use std::collections::BTreeMap;
use std::hash::{BuildHasher, Hasher, RandomState};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::builder::{BoolishValueParser, RangedU64ValueParser};
use clap::{ArgAction, Args, Subcommand, ValueEnum};
use vitreo_uq::base::error::{Error, InputPlace, Result, Setting};
use vitreo_uq::base::files::{Content, read_if_there};
use vitreo_uq::documents::diagnosis::Diagnosis;
use vitreo_uq::models::effects::Library;
use vitreo_uq::posterior::cache::cache_directory;
use vitreo_uq::posterior::monitor::Monitor;
use vitreo_uq::posterior::study::{DIAGNOSIS_NAME, Provenance, Study, WithProvenance};
use vitreo_uq::record::Experiment;
use vitreo_uq::sampling::ensemble::RandomStream;
use vitreo_uq::validation::challenge::files::{self, ChallengeCase, OpenedChallenge};
use vitreo_uq::validation::challenge::play::HiddenKind;
use vitreo_uq::validation::challenge::plays::{self, PlaysRequest};
use vitreo_uq::validation::challenge::{
    Bench, DisturbanceKind, HiddenPhysics, NoiseKind, Protocol, Strength, TruthRequest, draw_pair, hideable_effects,
};

use crate::challenge_words::{format_new_challenges, format_plays, format_truth};
use crate::options::use_threads;
use crate::terminal::Terminal;

/// Arguments of `challenge`.
#[derive(Args)]
pub struct ChallengeArguments {
    #[command(subcommand)]
    action: Action,
}

#[derive(Subcommand)]
enum Action {
    /// Make an experiment with a sealed answer, from full finite elements on a finer mesh
    New(NewArguments),
    /// Open the answer, and check whether the diagnosis was right
    Reveal(RevealArguments),
    /// Make and diagnose many challenges, and count the verdicts
    Run(RunArguments),
}

#[derive(Args)]
struct NewArguments {
    /// Directory to create
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Number of challenges; each gets its own directory below DIR, and their seeds are consecutive
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = RangedU64ValueParser::<usize>::new().range(1..=MOST_CASES))]
    count: usize,
    /// Hide this effect [default: a random choice]
    #[arg(long, value_name = "SLUG", conflicts_with_all = ["pair", "none", "outside"])]
    effect: Option<String>,
    /// Hide these two effects
    #[arg(long, value_name = "SLUG,SLUG", value_delimiter = ',', num_args = 1, conflicts_with_all = ["none", "outside"])]
    pair: Vec<String>,
    /// Hide no effect and no disturbance
    #[arg(long, conflicts_with = "outside")]
    none: bool,
    /// Hide a disturbance outside the library: of this kind, or without KIND of a random kind
    #[arg(long, value_name = "KIND")]
    outside: Option<Option<String>>,
    /// Signal of the hidden effect in noise standard deviations, or `prior` to draw the effect's size from its prior [default: random from 10 to 40]
    #[arg(long, value_name = "SIGMA|prior")]
    strength: Option<String>,
    /// Size of the hidden effect, in place of its signal: distance between its first parameter and the null, in the unit that `effects` lists
    #[arg(long, value_name = "VALUE", requires = "effect", conflicts_with = "strength", allow_negative_numbers = true)]
    size: Option<f64>,
    /// Protocol: paper (±F, 5 s each) or levels (three force levels and rests)
    #[arg(long, value_name = "NAME", default_value = "paper")]
    protocol: String,
    /// Noise: white; white with slow noise (ou), random gains (gain), outliers, or lost rows (lost); slow noise alone (ou-alone) or with outliers (ou-outliers)
    #[arg(long, value_name = "KIND", default_value = "white")]
    noise_kind: String,
    /// Write the noise standard deviation into the experiment; with `no`, the diagnosis must estimate it
    #[arg(long, value_name = "yes|no", default_value = "yes", action = ArgAction::Set, hide_possible_values = true, value_parser = BoolishValueParser::new())]
    noise_known: bool,
    /// Seed of all random numbers; it determines the answer [default: from the operating system]
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Do not show progress on standard error
    #[arg(long)]
    quiet: bool,
}

#[derive(Args)]
struct RevealArguments {
    /// Directory that `challenge new` created
    #[arg(value_name = "DIR")]
    dir: PathBuf,
    /// Study of the challenge's experiment [default: vitreo-uq-out/<specimen id>, if it exists]
    #[arg(long, value_name = "STUDY")]
    study: Option<PathBuf>,
    /// Write the result as one JSON document to a file, or with `-` to standard output in place of the text
    #[arg(long, value_name = "FILE|-")]
    json: Option<PathBuf>,
    /// Do not show progress on standard error
    #[arg(long)]
    quiet: bool,
}

#[derive(Args)]
struct RunArguments {
    #[command(flatten)]
    plays: PlaysArguments,
    /// Directory for full finite-element trajectories [default: VITREO_UQ_CACHE, or the user's cache directory]
    #[arg(long, value_name = "DIR")]
    cache: Option<PathBuf>,
    /// Write the result as one JSON document to a file, or with `-` to standard output in place of the text
    #[arg(long, value_name = "FILE|-")]
    json: Option<PathBuf>,
    /// Number of threads; 0 for as many as there are cores
    #[arg(long, value_name = "N", default_value_t = 0)]
    threads: usize,
    /// Do not show progress on standard error
    #[arg(long)]
    quiet: bool,
}

/// Options of `challenge run` and `tasks challenge`: the challenges to play.
#[derive(Args)]
pub struct PlaysArguments {
    /// Number of challenges
    #[arg(long, value_name = "N", default_value_t = 100)]
    count: usize,
    /// Number of the first challenge, from 0, so that a long run can be played in parts
    #[arg(long, value_name = "N", default_value_t = 0)]
    first: usize,
    /// Signals of the hidden effects in noise standard deviations, separated by commas
    #[arg(long, value_name = "SIGMA", value_delimiter = ',', default_values_t = [5.0, 10.0, 20.0, 40.0])]
    signal: Vec<f64>,
    /// Play only challenges with this sort of hidden disturbance [default: a mixture of all sorts]
    #[arg(long, value_name = "SORT", value_enum)]
    only: Option<OnlySort>,
    /// Hide these effects only, separated by commas
    #[arg(long, value_name = "SLUG", value_delimiter = ',')]
    effect: Vec<String>,
    /// Protocols, separated by commas: paper, levels [default: both]
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    protocol: Vec<String>,
    /// Noises, separated by commas; `challenge new --help` explains their names: white, ou, gain, outliers, ou-alone, ou-outliers, lost [default: the first four]
    #[arg(long, value_name = "KIND", value_delimiter = ',')]
    noise_kind: Vec<String>,
    /// Write the noise standard deviation into the experiments; with `no`, each diagnosis must estimate it
    #[arg(long, value_name = "yes|no", default_value = "yes", action = ArgAction::Set, hide_possible_values = true, value_parser = BoolishValueParser::new())]
    noise_known: bool,
    /// Seed of all random numbers
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

/// Sort of hidden disturbance to which `--only` restricts a run.
#[derive(Clone, Copy, ValueEnum)]
enum OnlySort {
    /// No hidden effect or disturbance
    None,
    /// One effect of the library
    Single,
    /// Two effects of the library
    Pair,
    /// A disturbance outside the library
    Outside,
    /// A wrong Poisson ratio, or a bead off the centre, which the law's parameters absorb
    Apparatus,
}

impl OnlySort {
    fn sort(self) -> HiddenKind {
        match self {
            Self::None => HiddenKind::None,
            Self::Single => HiddenKind::Single,
            Self::Pair => HiddenKind::Pair,
            Self::Outside => HiddenKind::Outside,
            Self::Apparatus => HiddenKind::Apparatus,
        }
    }
}

/// Maximum number of challenges that one command makes. All of them stay in memory until the last one is solved.
const MOST_CASES: u64 = 10_000;
/// Maximum number of challenges in one run. Such a run takes weeks.
const MOST_PLAYS: usize = 1_000_000;

pub fn run(arguments: &ChallengeArguments) -> Result<ExitCode> {
    match &arguments.action {
        Action::New(arguments) => make(arguments),
        Action::Reveal(arguments) => reveal(arguments),
        Action::Run(arguments) => play(arguments),
    }
}

fn make(arguments: &NewArguments) -> Result<ExitCode> {
    files::check_place(&arguments.out)?;
    use_threads(0)?;
    let seed = arguments.seed.unwrap_or_else(random_seed);
    let orders: Vec<TruthRequest> =
        (0..arguments.count).map(|number| challenge_order(arguments, seed_of(seed, number))).collect::<Result<_>>()?;
    let needed = orders.iter().flat_map(|order| match &order.hidden {
        HiddenPhysics::Effects(slugs) => &slugs[..],
        _ => &[],
    });
    let needed: Vec<String> = needed.cloned().collect();
    let terminal = Terminal::new(arguments.quiet);
    let bench = Bench::for_effects(&needed, &terminal)?;
    let width = arguments.count.to_string().len();
    let cases = orders.into_iter().enumerate().map(|(number, order)| ChallengeCase {
        dir: match arguments.count {
            1 => arguments.out.clone(),
            _ => arguments.out.join(format!("{:0width$}", number + 1)),
        },
        order,
        seed: seed_of(seed, number),
    });
    let commitments = files::make(&cases.collect::<Vec<_>>(), &bench, &terminal)?;
    terminal.finish();
    crate::output::show(None, &(), &format_new_challenges(&arguments.out, &commitments))?;
    Ok(ExitCode::SUCCESS)
}

/// Seed of challenge `number` of several challenges. With this seed the challenge can also be made alone.
fn seed_of(seed: u64, number: usize) -> u64 {
    seed.wrapping_add(number as u64)
}

/// Returns the request for the hidden truth of one challenge. Options that the user omits are drawn at random, with `seed`.
fn challenge_order(arguments: &NewArguments, seed: u64) -> Result<TruthRequest> {
    let protocol = named("--protocol", &arguments.protocol, &Protocol::ALL, Protocol::name)?;
    let noise = named("--noise-kind", &arguments.noise_kind, &NoiseKind::ALL, NoiseKind::name)?;
    // Random streams 0 to 2 generate the data, so stream 3 draws the omitted options.
    let mut stream = RandomStream::new(seed, 3);
    let strength = match arguments.size {
        Some(size) => Strength::Size(size),
        None => strength(arguments.strength.as_deref(), &mut stream)?,
    };
    let hidden = hidden(arguments, protocol, &mut stream)?;
    Ok(TruthRequest { hidden, protocol, noise, is_noise_given: arguments.noise_known, strength })
}

/// Returns an unpredictable seed. It comes from the keys of hash maps, which the operating system supplies.
fn random_seed() -> u64 {
    RandomState::new().build_hasher().finish()
}

/// Finds the element of `all` with the name `text`. The error names the option `option`.
fn named<T: Copy>(option: &str, text: &str, all: &[T], name: impl Fn(T) -> &'static str) -> Result<T> {
    all.iter().copied().find(|one| name(*one) == text).ok_or_else(|| {
        let names: Vec<&str> = all.iter().map(|one| name(*one)).collect();
        Error::input(
            InputPlace::default().at_key(option),
            format!("`{text}` is not a known name"),
            format!("give one of {}", names.join(", ")),
        )
    })
}

fn strength(text: Option<&str>, stream: &mut RandomStream) -> Result<Strength> {
    match text {
        None => Ok(Strength::Sigma(10.0 * 4_f64.powf(stream.unit()))),
        Some("prior") => Ok(Strength::Prior),
        Some(text) => match text.parse::<f64>() {
            Ok(sigma) if (0.5..=1e3).contains(&sigma) => Ok(Strength::Sigma(sigma)),
            _ => Err(Error::input(
                InputPlace::setting(Setting::Strength),
                format!("`{text}`"),
                "give a number from 0.5 to 1000, or `prior`",
            )),
        },
    }
}

fn hidden(arguments: &NewArguments, protocol: Protocol, stream: &mut RandomStream) -> Result<HiddenPhysics> {
    let suited: Vec<DisturbanceKind> = DisturbanceKind::drawn().filter(|kind| kind.suits(protocol)).collect();
    let library = Library::default();
    let slugs = hideable_effects(&library);
    if let Some(slug) = &arguments.effect {
        return Ok(HiddenPhysics::Effects(vec![slug.clone()]));
    }
    if !arguments.pair.is_empty() {
        return match arguments.pair.as_slice() {
            [a, b] if a != b => Ok(HiddenPhysics::Effects(vec![a.clone(), b.clone()])),
            _ => Err(Error::input(
                InputPlace::setting(Setting::Pair),
                arguments.pair.join(","),
                "give two different effects, such as `--pair softening,force-bias`",
            )),
        };
    }
    if let Some(Some(kind)) = &arguments.outside {
        return Ok(HiddenPhysics::Outside(named("--outside", kind, &DisturbanceKind::ALL, DisturbanceKind::name)?));
    }
    let choice = stream.unit();
    if arguments.none || (arguments.outside.is_none() && choice < 0.15) {
        return Ok(HiddenPhysics::Nothing);
    }
    if arguments.outside.is_some() || choice < 0.3 {
        return Ok(HiddenPhysics::Outside(suited[stream.below(suited.len())]));
    }
    if choice < 0.45 {
        return draw_pair(&library, &slugs, stream).map(|pair| HiddenPhysics::Effects(pair.to_vec()));
    }
    // The second effect is drawn but not used, so that each seed continues to give the same challenge.
    let (single, _) = stream.distinct_pair(slugs.len());
    Ok(HiddenPhysics::Effects(vec![slugs[single].clone()]))
}

fn reveal(arguments: &RevealArguments) -> Result<ExitCode> {
    crate::output::check(arguments.json.as_deref())?;
    let mut opened = files::open_challenge(&arguments.dir)?;
    let diagnosis = diagnosis_of(&opened, &arguments.dir, arguments.study.as_deref())?;
    if diagnosis.is_some() && !opened.answer.truth.not_compared.is_empty() {
        // `challenge new` omits these comparisons because they are slow. The diagnosis has cached the models that they need.
        let terminal = Terminal::new(arguments.quiet);
        let bench = Bench::new(&terminal)?;
        terminal.stage("comparing the hidden effect with the effects that change the displacement field");
        opened.answer.truth = bench.complete_ideal_class(&opened.answer.truth)?;
        terminal.finish();
    }
    let judged = diagnosis.map(|diagnosis| {
        let truth = opened.answer.truth.clone();
        (plays::judge(0, HiddenKind::of(&truth), truth, &diagnosis, opened.noise.as_ref()), diagnosis)
    });
    let looked_in = study_dir(&opened, arguments.study.as_deref());
    let words = format_truth(&opened, judged.as_ref(), &arguments.dir, &looked_in);
    let body = serde_json::json!({
        "truth": opened.answer.truth,
        "commitment_sha256": opened.commitment_sha256,
        "right": judged.as_ref().map(|(play, _)| play.is_right()),
        "said": judged.as_ref().map(|(play, _)| play.said.clone()),
        "play": judged.as_ref().map(|(play, _)| play),
    });
    let provenance = Provenance::new("challenge-answer", 1, 0, BTreeMap::new());
    crate::output::show(arguments.json.as_deref(), &WithProvenance { provenance, body }, &words)?;
    Ok(ExitCode::SUCCESS)
}

/// Directory of the challenge's study: `study` if it is given, otherwise the directory that `diagnose` uses by default.
fn study_dir(opened: &OpenedChallenge, study: Option<&Path>) -> PathBuf {
    let id = files::specimen_id(&opened.commitment_sha256);
    study.map_or_else(|| Study::default_dir(&id), Path::to_path_buf)
}

/// First diagnosis in a study of the challenge's data; `None` if there is no study, or no diagnosis in it.
fn diagnosis_of(opened: &OpenedChallenge, challenge_dir: &Path, study: Option<&Path>) -> Result<Option<Diagnosis>> {
    let dir = study_dir(opened, study);
    if study.is_none() && !Study::is_study(&dir) {
        return Ok(None);
    }
    let study = Study::open(&dir)?;
    let is_same_file = study.inputs_sha256().values().any(|hash| *hash == opened.answer.trajectory_sha256);
    if !is_same_file && !has_rows_of(&study, challenge_dir)? {
        return Err(Error::input(
            InputPlace::default().at_key("--study"),
            format!("{} is a study of different data", dir.display()),
            "give the study that `vitreo-uq diagnose` created for this challenge",
        ));
    }
    for revision in study.revisions()? {
        let path = study.revision_dir(&revision)?.join(DIAGNOSIS_NAME);
        let Some(bytes) = read_if_there(&path, Content::Document) else { continue };
        let read = serde_json::from_slice::<WithProvenance<Diagnosis>>(&bytes);
        return read.map(|document| Some(document.body)).map_err(|error| {
            Error::input(
                InputPlace::file(&path).at_line(error.line()),
                format!("this is not a diagnosis of this program: {error}"),
                "run `vitreo-uq diagnose` again",
            )
        });
    }
    Ok(None)
}

/// Largest difference between two tables' values that counts as rounding, as a fraction of the largest value. A conversion of units rounds.
const ROUNDING: f64 = 1e-9;

/// Returns whether a study has the rows of the challenge in `dir`. The layout and the units of its table may differ.
fn has_rows_of(study: &Study, dir: &Path) -> Result<bool> {
    let (ours, _) = Experiment::read(dir)?;
    let (theirs, _) = study.read_experiment()?;
    let are_same = |a: &[f64], b: &[f64]| {
        let largest = a.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
        a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() <= ROUNDING * largest)
    };
    // A study may omit positions, but it must contain more than half of them.
    let both = ours.record.position_m.iter().zip(&theirs.record.position_m);
    let (a, b): (Vec<f64>, Vec<f64>) = both.filter_map(|(ours, theirs)| Some(((*ours)?, (*theirs)?))).unzip();
    Ok(2 * a.len() > ours.record.n_rows()
        && are_same(&ours.record.time_s, &theirs.record.time_s)
        && are_same(&ours.record.force_n, &theirs.record.force_n)
        && are_same(&a, &b))
}

impl PlaysArguments {
    /// Converts the arguments to a request, and makes every check that needs no preparation.
    pub fn request(&self) -> Result<PlaysRequest> {
        if self.count > MOST_PLAYS {
            let found = format!("{} challenges", self.count);
            return Err(Error::input(
                InputPlace::setting(Setting::Count),
                found,
                format!("play at most {MOST_PLAYS} challenges in one run"),
            ));
        }
        if self.first > MOST_PLAYS {
            let found = format!("number {}", self.first);
            return Err(Error::input(
                InputPlace::default().at_key("--first"),
                found,
                format!("give a number of at most {MOST_PLAYS}"),
            ));
        }
        let many = |texts: &[String], all: Vec<String>| if texts.is_empty() { all } else { texts.to_vec() };
        let protocols = many(&self.protocol, Protocol::ALL.map(|p| p.name().to_string()).to_vec());
        let noises = many(&self.noise_kind, NoiseKind::USUAL.map(|n| n.name().to_string()).to_vec());
        let protocol = |text: &String| named("--protocol", text, &Protocol::ALL, Protocol::name);
        let noise = |text: &String| named("--noise-kind", text, &NoiseKind::ALL, NoiseKind::name);
        Ok(PlaysRequest {
            count: self.count,
            first: self.first,
            signals_sigma: self.signal.clone(),
            only: self.only.map(OnlySort::sort),
            effects: self.effect.clone(),
            protocols: protocols.iter().map(protocol).collect::<Result<_>>()?,
            noises: noises.iter().map(noise).collect::<Result<_>>()?,
            is_noise_given: self.noise_known,
            seed: self.seed,
        })
    }
}

fn play(arguments: &RunArguments) -> Result<ExitCode> {
    use_threads(arguments.threads)?;
    crate::output::check(arguments.json.as_deref())?;
    let request = arguments.plays.request()?;
    let terminal = Terminal::new(arguments.quiet);
    let bench = Bench::new(&terminal)?;
    let cache = arguments.cache.clone().or_else(|| Some(cache_directory()?.join("challenge")));
    let plays = plays::run(&bench, &request, cache.as_deref(), &plays::diagnose_briefly, &terminal)?;
    terminal.finish();
    let words = format_plays(&plays.tally);
    crate::output::show(arguments.json.as_deref(), &plays.document(request.seed), &words)?;
    Ok(ExitCode::SUCCESS)
}
