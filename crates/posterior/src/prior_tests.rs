use super::*;
use laws::rheology::{BaseLaw, Network};
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
    base::parameter::YOUNG_MODULUS,
    ParameterSpec::new("fraction", "f", "1", base::parameter::Support { lower: 0.0, upper: 1.0 }),
];

fn read(text: &str) -> Result<PriorSet> {
    PriorSet::from_text(Path::new("p.toml"), text.as_bytes(), KNOWN, &[], &no_default)
}

#[test]
fn every_embedded_prior_is_complete_and_says_where_it_comes_from() {
    for name in PriorSet::builtin_names() {
        let set = PriorSet::named(name).unwrap();
        assert_eq!(set.name(), name);
        let expected: Vec<&str> = BASE_PARAMETERS.iter().map(|spec| spec.name).collect();
        assert_eq!(set.names().collect::<Vec<_>>(), expected);
        assert!(set.priors().iter().all(|prior| prior.source.len() > 20));
    }
    assert_eq!(PriorSet::builtin_names().next(), Some("porcine"));
}

/// Each file in `priors/` is built in and named in the users' documentation of priors.
#[test]
fn every_prior_file_is_embedded_and_documented() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let files = std::fs::read_dir(root.join("priors")).unwrap();
    let mut stems: Vec<String> =
        files.map(|file| file.unwrap().path().file_stem().unwrap().to_str().unwrap().into()).collect();
    let mut names: Vec<&str> = PriorSet::builtin_names().collect();
    stems.sort();
    names.sort_unstable();
    assert_eq!(stems, names);
    let documentation = include_str!("../../../docs/experiment.md");
    assert!(names.iter().all(|name| documentation.contains(&format!("`{name}`"))), "docs/experiment.md misses one");
}

/// The published values of the three parameters come from Wang 2013 (Table I), Sharif-Kashani 2011 and Lee 1994.
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

/// Mean and standard deviation of a parameter, from `median` and `log_sd` of its log-normal prior.
fn moments(set: &PriorSet, name: &str) -> (f64, f64) {
    let Distribution::LogNormal { median, log_sd } = set.get(name).unwrap().distribution else { panic!("{name}") };
    let mean = median * (0.5 * log_sd * log_sd).exp();
    (mean, mean * (log_sd * log_sd).exp_m1().sqrt())
}

#[test]
fn published_moments_are_those_of_the_literature() {
    let cases = [
        ("lee-1994", "young_modulus_pa", 0.937, 0.22 * 0.937),
        ("lee-1994", "viscosity_1_pa_s", 0.599, 0.30 * 0.599),
        ("lee-1994", "viscosity_2_pa_s", 8.402, 0.36 * 8.402),
        ("sharif-kashani-2011", "young_modulus_pa", 1.66, 0.96),
        // The factor 2.96 = 2 (1 + ν), with Poisson's ratio ν, converts the storage modulus of Nickerson et al. 2008 into Young's modulus.
        ("nickerson-2008-porcine", "young_modulus_pa", 2.96 * 2.8, 2.96 * 0.9),
        ("nickerson-2008-bovine", "young_modulus_pa", 2.96 * 7.0, 2.96 * 2.0),
    ];
    for (prior, parameter, mean, sd) in cases {
        let found = moments(&PriorSet::named(prior).unwrap(), parameter);
        assert!((found.0 / mean - 1.0).abs() < 1e-9 && (found.1 / sd - 1.0).abs() < 1e-9, "{prior}: {found:?}");
    }
}

/// Wang 2013 publishes all values without a standard deviation, and Sharif-Kashani 2011 both viscosities.
#[test]
fn values_published_without_spread_are_medians() {
    let is_median = |prior: &str, parameter: &str, value: f64| {
        let distribution = PriorSet::named(prior).unwrap().get(parameter).unwrap().distribution;
        assert_eq!(distribution, Distribution::LogNormal { median: value, log_sd: 0.7 }, "{prior}: {parameter}");
        // The prior's source calls this standard deviation a factor of 2.
        assert!((0.7_f64.exp() - 2.0).abs() < 0.02);
    };
    for (parameter, value) in LETHERSICH.iter().zip([3.527, 1.402, 47.370]) {
        is_median("wang-2013", parameter.name, value);
    }
    is_median("sharif-kashani-2011", "viscosity_1_pa_s", 2.4);
    is_median("sharif-kashani-2011", "viscosity_2_pa_s", 70.0);
}

/// Parameters without a published value have the default prior, and their `source` says that it is assumed.
#[test]
fn parameters_that_a_publication_leaves_open_are_the_porcine_prior_s() {
    let porcine = PriorSet::named("porcine").unwrap();
    for name in PriorSet::builtin_names().filter(|name| !["porcine", "generic"].contains(name)) {
        let set = PriorSet::named(name).unwrap();
        for prior in set.priors().iter().filter(|prior| prior.source.contains("not from this publication")) {
            assert_eq!(prior.distribution, porcine.get(&prior.name).unwrap().distribution, "{name}: {}", prior.name);
        }
        assert!(set.priors().iter().all(|p| p.source.contains("assumed")), "{name}");
        assert!(set.get(NOISE_SD.name).unwrap().source.contains("not from this publication"), "{name}");
    }
}

/// Creep J and relaxation G of a material fulfil s G̃(s) · s J̃(s) = 1 for their Laplace transforms at every s. G is the published relaxation. J is the prior file's
/// Kelvin–Voigt body in series with the instantaneous spring.
#[test]
fn the_aboulatta_prior_creeps_as_the_published_relaxation() {
    let (g0, g_inf, decay) = (2.10, 0.50, 1.20);
    let set = PriorSet::named("aboulatta-2021").unwrap();
    let (e, e_sd) = moments(&set, "young_modulus_pa");
    let (c1, c1_sd) = moments(&set, "viscosity_1_pa_s");
    for s in [0.0, 0.05, 0.3, 1.0, 7.0, 400.0] {
        let relaxation = g_inf + (g0 - g_inf) * s / (s + decay);
        // The factor 2 (1 + ν) = 2.96, with Poisson's ratio ν, converts the compliance under uniaxial stress into the compliance under shear.
        let creep = 1.0 / g0 + 2.96 / (e + c1 * s);
        assert!((relaxation * creep - 1.0).abs() < 1e-9, "s = {s}");
    }
    assert!((2.96_f64.recip() * e - 0.65625).abs() < 1e-9 && (c1 / e - 3.5).abs() < 1e-9);
    // Standard deviations are propagated to first order by central differences.
    let derived = |g: [f64; 3]| {
        let e = 2.96 / (1.0 / g[1] - 1.0 / g[0]);
        [e, e * g[0] / (g[2] * g[1])]
    };
    let mut variance = [0.0; 2];
    for (i, sd) in [0.15, 0.04, 0.09].into_iter().enumerate() {
        let (mut above, mut below) = ([g0, g_inf, decay], [g0, g_inf, decay]);
        above[i] += 1e-3 * sd;
        below[i] -= 1e-3 * sd;
        for (sum, (a, b)) in variance.iter_mut().zip(derived(above).into_iter().zip(derived(below))) {
            *sum += ((a - b) / 2e-3).powi(2);
        }
    }
    assert!((variance[0].sqrt() / e_sd - 1.0).abs() < 1e-4 && (variance[1].sqrt() / c1_sd - 1.0).abs() < 1e-4);
    assert!((e_sd / e - 0.107).abs() < 5e-4 && (c1_sd / c1 - 0.093).abs() < 5e-4);
}

#[test]
fn files_and_names_are_told_apart() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("mine.toml");
    std::fs::write(&path, include_str!("../../../priors/lee-1994.toml")).unwrap();
    let from_file = PriorSet::read(path.to_str().unwrap()).unwrap();
    assert_eq!(from_file.priors(), PriorSet::named("lee-1994").unwrap().priors());
    assert_eq!(from_file.text(), PriorSet::named("lee-1994").unwrap().text());
    let message = PriorSet::read("lee-1949").unwrap_err().to_string();
    assert!(message.contains("`prior`") && message.contains("did you mean `lee-1994`?"), "{message}");
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
        // Earlier parameters already have their priors.
        assert_eq!(before.len(), usize::from(spec.name == "fraction"));
        defaults.iter().find(|prior| prior.name == spec.name).cloned()
    };
    let set = PriorSet::from_text(Path::new("p.toml"), text.as_bytes(), KNOWN, &[], &of_spec).unwrap();
    assert_eq!(set.get("fraction"), Some(&defaults[0]));
    assert_eq!(set.get("young_modulus_pa").unwrap().source, "s");
}

/// A prior file may serve several models, so it may hold parameters of other models.
#[test]
fn parameters_of_other_models_may_stand_in_the_file() {
    let read =
        |others: &[&str]| PriorSet::from_text(Path::new("p.toml"), VALID.as_bytes(), &KNOWN[..1], others, &no_default);
    assert_eq!(read(&["fraction"]).unwrap().names().collect::<Vec<_>>(), ["young_modulus_pa"]);
    let error = read(&[]).unwrap_err().to_string();
    assert!(error.contains("p.toml") && error.contains("fraction"), "{error}");
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
            // The Jacobian of a logarithmic coordinate is dx/dz = x.
            .map(|(prior, x)| prior.distribution.ln_pdf(*x) + x.ln())
            .sum();
        assert!((value - 0.5 - expected).abs() < 1e-11);
    }
}

/// Two parallel springpots have equal priors. The density is doubled in one order and 0 in the other, and every draw is in order. With different priors, both orders
/// are allowed.
#[test]
fn interchangeable_parts_stand_in_order() {
    let text = "parallel = [{ springpot = \"fast\" }, { springpot = \"slow\" }]";
    let law = BaseLaw::Network(Network::from_text("law.toml".as_ref(), text).expect("a network"));
    let of = |slow_order: Distribution| {
        let prior = |name: &str, unit: &str, distribution| Prior {
            name: name.into(),
            distribution,
            unit: unit.into(),
            source: String::new(),
        };
        let modulus = Distribution::LogNormal { median: 3.0, log_sd: 1.0 };
        let order = Distribution::Uniform { lower: 0.0, upper: 1.0 };
        let all = [
            prior("fast_modulus_pa", "Pa", modulus),
            prior("fast_order", "1", order),
            prior("slow_modulus_pa", "Pa", modulus),
            prior("slow_order", "1", slow_order),
        ];
        let others = read(VALID).expect("sound").without(&["young_modulus_pa", "fraction"]);
        others.with(&all).with_order(law.interchangeable_parts())
    };
    let ln_density = |set: &PriorSet, natural: &[f64]| {
        let (mut by_value, mut by_coordinate) = ([0.0], [0.0]);
        set.add_ln_pdf(natural, &mut by_value);
        set.add_ln_pdf_unconstrained(&set.to_unconstrained(natural), &mut by_coordinate);
        assert_eq!(by_value[0].is_finite(), by_coordinate[0].is_finite());
        let each: f64 = set.distributions().zip(natural).map(|(distribution, x)| distribution.ln_pdf(*x)).sum();
        by_value[0] - each
    };
    let alike = of(Distribution::Uniform { lower: 0.0, upper: 1.0 });
    // In two parallel springpots, the one of higher order acts faster.
    assert!((ln_density(&alike, &[2.0, 0.8, 5.0, 0.3]) - 2.0_f64.ln()).abs() < 1e-12);
    assert_eq!(ln_density(&alike, &[5.0, 0.3, 2.0, 0.8]), f64::NEG_INFINITY);
    assert_eq!(alike.ordered(vec![5.0, 0.3, 2.0, 0.8]), [2.0, 0.8, 5.0, 0.3]);
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
    for _ in 0..50 {
        let draw = alike.draw(&mut rng);
        assert!(draw[1] >= draw[3], "{draw:?}");
    }
    let known_apart = of(Distribution::Uniform { lower: 0.0, upper: 0.5 });
    assert_eq!(ln_density(&known_apart, &[5.0, 0.2, 2.0, 0.4]), 0.0);
    assert_eq!(ln_density(&alike.without(&["slow_order"]), &[5.0, 0.3, 2.0]), 0.0);
}
