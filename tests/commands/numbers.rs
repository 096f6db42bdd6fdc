//! One quantity has one value: a study's documents, its page and the output of all commands agree.

use crate::program;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use program::{normals, vitreo};
use serde_json::Value;
use vitreo_uq::jobs::pages;

/// Writes an instrument's experiment with four cycles of ±1 µN for 2 s each and 3 µm of unstated noise. A spring in series has a twentieth of the elastic
/// compliance.
fn write_with_spring(dir: &Path) {
    std::fs::create_dir_all(dir).unwrap();
    let toml = "[specimen]\nid = \"gel\"\n[instrument]\ncompliance_per_m = 549.0\n[measurement]\nfile = \"trajectory.csv\"\n\
        calibration_cycles = [1]\nheldout_cycles = [2, 3, 4]\nsource = \"synthetic: closed form\"\n";
    std::fs::write(dir.join("experiment.toml"), toml).unwrap();
    let (young_modulus_pa, viscosity_1_pa_s, viscosity_2_pa_s, compliance_per_m, step_s) =
        (3.5, 1.4, 47.0, 549.0, 0.08);
    let decay = f64::exp(-step_s * young_modulus_pa / viscosity_1_pa_s);
    let (mut retarded_un, mut impulse_un_s, mut before_un, mut normal) = (0.0, 0.0, 0.0, normals());
    let mut csv = String::from("time_s,force_uN,position_um,cycle\n");
    for row in 0..200 {
        let force_un = if (row / 25) % 2 == 0 { 1.0 } else { -1.0 };
        let strain = (retarded_un + 0.05 * before_un) / young_modulus_pa + impulse_un_s / viscosity_2_pa_s;
        let position_um = compliance_per_m * strain + 3.0 * normal();
        csv += &format!("{:.2},{force_un},{position_um:.4},{}\n", step_s * f64::from(row), 1 + row / 50);
        retarded_un = decay * retarded_un + (1.0 - decay) * force_un;
        impulse_un_s += step_s * force_un;
        before_un = force_un;
    }
    std::fs::write(dir.join("trajectory.csv"), csv).unwrap();
}

/// Values of quantities with the places where they appear. The keys are the revision with its fitted cycles, and the quantity's name.
#[derive(Default)]
struct Quantities(BTreeMap<(String, String), BTreeMap<String, Vec<String>>>);

/// Model to which the quantities in a document refer.
#[derive(Clone)]
struct About {
    /// Revision.
    revision: String,
    /// Cycles that the revision was fitted to.
    cycles: String,
    /// Revision that `revision` extends.
    from: String,
}

impl Quantities {
    /// Names of quantities, and their names in the document of `sample`.
    const NAMES: [(&str, &str); 3] =
        [("rmse_fitted_um", "rmse_fitted_um"), ("rmse_heldout_um", "rmse_um"), ("noise_um", "noise_um")];
    /// Models other than revisions: fits of a search, and those beside a diagnosis.
    const OTHER_MODELS: [&str; 4] = ["candidates", "extended", "equivalents", "shifts"];

    fn add(&mut self, about: &About, name: &str, value: &Value, place: &str) {
        let model =
            if name == "noise_um" { "study".into() } else { format!("{} given {}", about.revision, about.cycles) };
        let values = self.0.entry((model, name.into())).or_default();
        values.entry(value.to_string()).or_default().push(place.into());
    }

    /// Adds all quantities of a document.
    fn read(&mut self, document: &Value, about: &About, place: &str) {
        if let Value::Array(list) = document {
            list.iter().enumerate().for_each(|(k, value)| self.read(value, about, &format!("{place}[{k}]")));
        }
        let Value::Object(map) = document else { return };
        let mut about = about.clone();
        if let Some(revision) = map.get("revision").and_then(Value::as_str) {
            about.revision = revision.into();
        }
        let is_of_sample = document["heldout"]["fitted_cycles"].is_array();
        for cycles in [&document["fitted_cycles"], &document["heldout"]["fitted_cycles"]] {
            if cycles.is_array() {
                about.cycles = cycles.to_string();
            }
        }
        for (key, value) in map {
            let at = format!("{place}.{key}");
            let known =
                Self::NAMES.iter().find(|names| *key == if place.ends_with(".heldout") { names.1 } else { names.0 });
            match (known, key.as_str()) {
                (Some((name, _)), _) => self.add(&about, name, value, &at),
                (None, "parameters") => {
                    for parameter in value.as_array().into_iter().flatten().filter(|value| value["median"].is_number())
                    {
                        self.add(&about, parameter["name"].as_str().unwrap_or("?"), &parameter["median"], &at);
                    }
                }
                (None, "before") => self.read(value, &About { revision: about.from.clone(), ..about.clone() }, &at),
                (None, key) if Self::OTHER_MODELS.contains(&key) || is_of_sample && key == "error_budget_um" => {}
                _ => self.read(value, &about, &at),
            }
        }
    }

    fn value(&self, model: &str, name: &str) -> f64 {
        let values = &self.0[&(model.to_string(), name.to_string())];
        values.keys().next().and_then(|value| value.parse().ok()).expect("a number")
    }

    /// Quantities with several values.
    fn disagreements(&self) -> Vec<String> {
        let several = self.0.iter().filter(|(_, values)| values.len() > 1);
        several.map(|((model, name), values)| format!("{name} of {model}: {values:?}")).collect()
    }

    /// Number of places of a quantity.
    fn n_places(&self, model: &str, name: &str) -> usize {
        self.0[&(model.to_string(), name.to_string())].values().map(Vec::len).sum()
    }
}

/// Text of a page without markup.
fn words(page: &str) -> String {
    let inside = page.split('<').map(|part| part.split_once('>').map_or(part, |(_, text)| text));
    inside.collect::<Vec<_>>().join(" ").split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Numbers in a text that follow a name, as written.
fn numbers_after<'a>(words: &'a str, name: &str) -> Vec<&'a str> {
    let is_number = |text: &&str| text.parse::<f64>().is_ok();
    let first = |(at, _): (usize, &str)| {
        let rest = words[at + name.len()..].trim_start_matches([' ', ':', '(']).trim_start_matches("is ");
        let text = rest.split(|c: char| !c.is_ascii_digit() && c != '.').next();
        // A percentage of the noise is another quantity.
        let is_share = text.is_some_and(|text| rest[text.len()..].starts_with(" %"));
        text.map(|text| text.trim_end_matches('.')).filter(|text| !is_share && is_number(text))
    };
    // The inferred noise is another quantity.
    let is_own = |(at, _): &(usize, &str)| !words[..*at].ends_with("learnt ");
    words.match_indices(name).filter(is_own).filter_map(first).collect()
}

/// Returns `true` if a written number is a value rounded to the written digits.
fn is_rounded(text: &str, value: f64) -> bool {
    let decimals = text.split_once('.').map_or(0, |(_, decimals)| decimals.len() as i32);
    text.parse::<f64>().is_ok_and(|shown| (shown - value).abs() <= 0.501 * 10_f64.powi(-decimals))
}

/// Numbers in a text before a name, as written.
fn numbers_before<'a>(words: &'a str, name: &str) -> Vec<&'a str> {
    let last = |(at, _): (usize, &str)| words[..at].trim_end().trim_end_matches(" µm").rsplit(' ').next();
    words.match_indices(name).filter_map(last).filter(|text| text.parse::<f64>().is_ok()).collect()
}

/// Errors, noise and every parameter of a revision with given fitted cycles have one value in all documents, in the output of every command, on the page and in
/// the workbench's parts. The expected error of an effect comes from a best fit instead of a posterior, so it agrees with the error after `extend` only within
/// a twentieth.
#[test]
fn one_quantity_has_one_value_everywhere() {
    let dir = tempfile::tempdir().unwrap();
    write_with_spring(&dir.path().join("gel"));
    let study = dir.path().join("study");
    let mut said = Vec::new();
    let mut run = |arguments: &[&str]| {
        let run = vitreo(dir.path(), &[arguments, &["--quiet"]].concat()).exits(0);
        said.push((arguments.join(" "), run.stdout.clone()));
        said.push((
            format!("the page after {}", arguments.join(" ")),
            words(&std::fs::read_to_string(study.join("report.html")).unwrap()),
        ));
        for revision in ["m0", "m1"].into_iter().filter(|revision| study.join(revision).is_dir()) {
            let parts = pages::parts(&study, revision).unwrap();
            said.extend(parts.into_iter().map(|(id, html)| (format!("the workbench's {id}"), words(&html))));
        }
    };
    run(&["sample", "gel", "--out", "study"]);
    run(&["compare", "study"]);
    run(&["diagnose", "study"]);
    run(&["extend", "study", "--with", "instantaneous-elasticity"]);
    run(&["compare", "study"]);
    run(&["diagnose", "study", "--verbose"]);
    run(&["ladder", "study"]);
    // The brief text fits a screen and ends with the next command; the verbose text lists every effect.
    let printed =
        |command: &str| said.iter().find(|(place, _)| place == command).map(|(_, text)| text.as_str()).unwrap();
    let brief = printed("diagnose study");
    assert!(brief.lines().count() <= 25 && brief.contains("\nNext:  vitreo-uq extend study --with "), "{brief}");
    let verbose = printed("diagnose study --verbose");
    assert!(vitreo_uq::models::effects::EFFECTS.iter().all(|effect| verbose.contains(effect.slug())), "{verbose}");
    let read = |name: &str| -> Value { serde_json::from_slice(&std::fs::read(study.join(name)).unwrap()).unwrap() };
    let mut quantities = Quantities::default();
    let documents = ["posterior.json", "last_cycle.json", "comparison.json", "diagnosis.json", "extension.json"];
    for (revision, name) in ["m0", "m1"].iter().flat_map(|revision| documents.map(|name| (*revision, name))) {
        let place = format!("{revision}/{name}");
        if study.join(&place).is_file() {
            let about = About { revision: revision.into(), cycles: String::new(), from: "m0".into() };
            quantities.read(&read(&place), &about, &place);
        }
    }
    let about = About { revision: "study".into(), cycles: String::new(), from: String::new() };
    quantities.read(&read("ladder.json"), &about, "ladder.json");
    assert_eq!(quantities.disagreements(), Vec::<String>::new());
    // m0: its second posterior, `compare`, `diagnose`, `extend`, `ladder`. m1: likewise without `extend`, whose `after` and own posterior count as two.
    let [first, second] = ["m0 given [1,2,3]", "m1 given [1,2,3]"];
    assert_eq!([first, second].map(|model| quantities.n_places(model, "rmse_heldout_um")), [5, 5]);

    let noise_um = quantities.value("study", "noise_um");
    let heldout_um = [quantities.value("m0 given [1]", "rmse_heldout_um"), quantities.value(second, "rmse_heldout_um")];
    let last_um = [first, second].map(|model| quantities.value(model, "rmse_heldout_um"));
    let named: [(&str, &[f64]); 5] = [
        ("noise", &[noise_um]),
        ("held-out error", &heldout_um),
        ("the error on the last held-out cycle goes from", &last_um[..1]),
        ("error on the last held-out cycle falls:", &last_um[..1]),
        ("the error on the last held-out cycle falls: from", &last_um[..1]),
    ];
    let mut wrong = BTreeSet::new();
    let mut n_said = BTreeMap::new();
    for (place, text) in &said {
        let after = named.iter().map(|(name, values)| (*name, numbers_after(text, name), *values));
        let of_comparison = "on the last held-out cycle; noise";
        let before = (of_comparison, numbers_before(text, of_comparison), &last_um[..]);
        for (name, numbers, values) in after.chain([before]) {
            *n_said.entry(name).or_insert(0) += numbers.len();
            let others = numbers.into_iter().filter(|number| !values.iter().any(|value| is_rounded(number, *value)));
            wrong.extend(others.map(|number| format!("{name} {number} in {place}")));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?} beside noise {noise_um}, {heldout_um:?}, {last_um:?}");
    assert!(n_said.values().all(|n| *n > 0), "the words give the numbers: {n_said:?}");

    let diagnosis = read("m0/diagnosis.json");
    let expected_um = diagnosis["extended"]["rmse_heldout_um"].as_f64().expect("a claim");
    assert!(last_um[1] < last_um[0] && (expected_um / last_um[1] - 1.0).abs() < 0.05, "{expected_um} {last_um:?}");
    let is_claimed = |value: &&Value| value["effect"] == "instantaneous-elasticity";
    let candidate = diagnosis["candidates"].as_array().unwrap().iter().find(is_claimed).unwrap();
    assert_eq!(candidate["refit"]["rmse_heldout_um"], diagnosis["extended"]["rmse_heldout_um"]);
}
