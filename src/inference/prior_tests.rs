use super::*;
use rand::SeedableRng;

const VALID: &str = "\
[young_modulus_pa]
distribution = \"log_normal\"
median = 1.8
log_sd = 1.25
unit = \"Pa\"
source = \"s\"
[fraction]
distribution = \"beta\"
alpha = 2
beta = 3.0
unit = \"1\"
source = \"s\"
";

const KNOWN: &[ParameterSpec] = &[
    ParameterSpec { name: "young_modulus_pa", unit: "Pa", support: Support::POSITIVE },
    ParameterSpec { name: "fraction", unit: "1", support: Support { lower: 0.0, upper: 1.0 } },
];

fn read(text: &str) -> Result<PriorSet> {
    PriorSet::from_text(Path::new("p.toml"), text.as_bytes(), KNOWN, &[], &no_default)
}

#[test]
fn every_embedded_prior_is_complete_and_says_where_it_comes_from() {
    for name in PriorSet::embedded_names() {
        let set = PriorSet::named(name).unwrap();
        assert_eq!(set.name(), name);
        let expected: Vec<&str> = BASE_PARAMETERS.iter().map(|spec| spec.name).collect();
        assert_eq!(set.names().collect::<Vec<_>>(), expected);
        assert!(set.priors().iter().all(|prior| prior.source.len() > 20));
    }
    assert_eq!(PriorSet::embedded_names().next(), Some("porcine"));
}

/// The published fits: Wang 2013 Table I, Sharif-Kashani 2011, Lee 1994 (E, c₁, c₂).
#[test]
fn published_values_lie_well_inside_the_porcine_prior() {
    let set = PriorSet::named("porcine").unwrap();
    for published in [[3.527, 1.402, 47.370], [1.66, 2.4, 70.0], [0.937, 0.599, 8.402]] {
        for (prior, value) in set.priors().iter().zip(published) {
            let p = prior.distribution.cdf(value);
            assert!((0.1..=0.9).contains(&p), "{} = {value} at {p}", prior.name);
            let Distribution::LogNormal { log_sd, .. } = prior.distribution else { panic!("{prior:?}") };
            assert!((3.0..=4.0).contains(&log_sd.exp()));
        }
    }
}

#[test]
fn published_moments_are_those_of_the_literature() {
    let set = PriorSet::named("lee-1994").unwrap();
    for (prior, (mean, relative_sd)) in set.priors().iter().zip([(0.937, 0.22), (0.599, 0.30), (8.402, 0.36)]) {
        let Distribution::LogNormal { median, log_sd } = prior.distribution else { panic!("{prior:?}") };
        // Moments of a log-normal from its median and log_sd.
        assert!((median * (0.5 * log_sd * log_sd).exp() - mean).abs() < 1e-9);
        assert!(((log_sd * log_sd).exp_m1().sqrt() - relative_sd).abs() < 1e-9);
    }
}

#[test]
fn files_and_names_are_told_apart() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("mine.toml");
    std::fs::write(&path, include_str!("../../priors/lee-1994.toml")).unwrap();
    let from_file = PriorSet::read(path.to_str().unwrap()).unwrap();
    assert_eq!(from_file.priors(), PriorSet::named("lee-1994").unwrap().priors());
    assert_eq!(from_file.text(), PriorSet::named("lee-1994").unwrap().text());
    let message = PriorSet::read("lee-1949").unwrap_err().to_string();
    assert!(message.contains("--prior") && message.contains("did you mean `lee-1994`?"), "{message}");
}

#[test]
fn a_parameter_left_out_takes_its_default_and_a_given_one_overrides_it() {
    let text = &VALID[..VALID.find("[fraction]").unwrap()];
    let default = |name: &str| Prior {
        name: name.into(),
        distribution: Distribution::Uniform { lower: 0.0, upper: 0.5 },
        unit: "1".into(),
        source: "default".into(),
    };
    let defaults = [default("fraction"), default("young_modulus_pa")];
    let of_spec = |spec: &ParameterSpec, before: &[Prior]| {
        // What comes before is there already.
        assert_eq!(before.len(), usize::from(spec.name == "fraction"));
        defaults.iter().find(|prior| prior.name == spec.name).cloned()
    };
    let set = PriorSet::from_text(Path::new("p.toml"), text.as_bytes(), KNOWN, &[], &of_spec).unwrap();
    assert_eq!(set.get("fraction"), Some(&defaults[0]));
    assert_eq!(set.get("young_modulus_pa").unwrap().source, "s");
}

/// One file may serve several models.
#[test]
fn parameters_of_other_models_may_stand_in_the_file() {
    let read =
        |others: &[&str]| PriorSet::from_text(Path::new("p.toml"), VALID.as_bytes(), &KNOWN[..1], others, &no_default);
    assert_eq!(read(&["fraction"]).unwrap().names().collect::<Vec<_>>(), ["young_modulus_pa"]);
    assert!(read(&[]).is_err());
}

#[test]
fn unacceptable_priors_are_refused_with_line_key_and_remedy() {
    // (text replaced, replacement, line, key, words of the message, words of the remedy)
    let cases = [
        ("[fraction]", "[fractoin]", 7, "fractoin", "unknown key", "did you mean `fraction`"),
        ("unit = \"Pa\"", "unit = \"kPa\"", 5, "young_modulus_pa.unit", "`kPa`", "unit = \"Pa\""),
        ("unit = \"Pa\"\n", "", 1, "young_modulus_pa.unit", "missing", "unit = \"Pa\""),
        ("source = \"s\"\n[", "[", 1, "young_modulus_pa.source", "missing", "source ="),
        ("\"log_normal\"", "\"lognormal\"", 2, "young_modulus_pa.distribution", "`lognormal`", "`log_normal`"),
        ("distribution = \"beta\"\n", "", 7, "fraction.distribution", "missing", "distribution ="),
        ("median = 1.8", "median = -1.8", 3, "young_modulus_pa.median", "-1.8 is not above zero", "above zero"),
        ("median = 1.8", "median = inf", 3, "young_modulus_pa.median", "not a finite", "finite"),
        ("median = 1.8", "median = \"1.8\"", 3, "young_modulus_pa.median", "expected a decimal number", "median = 1.0"),
        ("median = 1.8\n", "", 1, "young_modulus_pa.median", "missing", "median = 1.8"),
        ("median = 1.8", "median = 1.8\nmean = 2.0", 4, "young_modulus_pa.mean", "twice", "keep"),
        ("log_sd = 1.25", "logsd = 1.25", 4, "young_modulus_pa.logsd", "unknown key", "did you mean `log_sd`"),
        ("log_sd = 1.25", "log_sd = 0", 4, "young_modulus_pa.log_sd", "not above zero", "above zero"),
        ("alpha = 2", "alpha = 2\nupper = 1.5", 8, "fraction.distribution", "[0, 1.5]", "inside that interval"),
        ("alpha = 2", "alpha = 2\nupper = -1", 10, "fraction.upper", "not above", "`lower` below"),
        ("alpha = 2", "alpha = 2\nalpha = 3", 10, "", "not valid TOML", "each key once"),
        (
            "\"log_normal\"\nmedian = 1.8\nlog_sd",
            "\"normal\"\nmean = 1.8\nsd",
            2,
            "young_modulus_pa.distribution",
            "-inf",
            "log_normal",
        ),
    ];
    read(VALID).unwrap();
    for (from, to, line, key, found, remedy) in cases {
        let text = VALID.replacen(from, to, 1);
        assert_ne!(text, VALID, "{from}");
        let Err(Error::Input { place, found: was, remedy: advice }) = read(&text) else { panic!("accepted: {to}") };
        assert_eq!((place.line, place.key.as_deref().unwrap_or("")), (Some(line), key), "{to}: {was}");
        assert!(was.contains(found), "{to}: {was}");
        assert!(advice.contains(remedy), "{to}: {advice}");
    }
    let Err(Error::Input { place, remedy, .. }) = read(&VALID[..VALID.find("[fraction]").unwrap()]) else { panic!() };
    assert_eq!(place.key.as_deref(), Some("fraction"));
    assert!(remedy.contains("[fraction]") && remedy.contains("unit = \"1\""), "{remedy}");
}

#[test]
fn boxes_batches_and_subsets_agree_with_the_single_priors() {
    let set = PriorSet::named("porcine").unwrap().without(&["viscosity_1_pa_s"]);
    assert_eq!(set.names().count(), 3);
    for ((low, high), prior) in set.box_quantiles(1e-3).into_iter().zip(set.priors()) {
        assert!(
            (prior.distribution.cdf(low) - 1e-3).abs() < 1e-12 && (prior.distribution.cdf(high) - 0.999).abs() < 1e-12
        );
    }
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
    let points: Vec<Vec<f64>> = (0..5).map(|_| set.to_unconstrained(&set.draw(&mut rng))).collect();
    let batch: Vec<f64> = (0..3).flat_map(|d| points.iter().map(move |point| point[d])).collect();
    let mut log_density = vec![0.5; 5];
    set.add_ln_pdf_unconstrained(&batch, &mut log_density);
    for (point, value) in points.iter().zip(log_density) {
        let natural = set.from_unconstrained(point);
        let expected: f64 = set
            .priors()
            .iter()
            .zip(&natural)
            // dx/dz = x for a log coordinate.
            .map(|(prior, x)| prior.distribution.ln_pdf(*x) + x.ln())
            .sum();
        assert!((value - 0.5 - expected).abs() < 1e-11);
    }
}
