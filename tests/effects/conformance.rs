//! Rules for every effect of the library (physics §5) that can be checked without solving a model.

use vitreo_uq::base::distribution::Distribution;
use vitreo_uq::base::error::{Error, InputPlace, Setting};
use vitreo_uq::base::number::Dual;
use vitreo_uq::laws::rheology::BaseLaw;
use vitreo_uq::models::effects::{EFFECTS, Effect, EffectParameter, Stage, Stages};
use vitreo_uq::models::model::Model;
use vitreo_uq::record::CharacteristicSizes;

pub const PORCINE: CharacteristicSizes = CharacteristicSizes {
    largest_force_n: 4.6e-6,
    position_range_m: 0.98e-3,
    hold_s: 5.0,
    cycle_s: 10.0,
    sample_interval_s: 0.05,
    duration_s: 40.0,
    poisson_ratio: Some(0.48),
    robot_radius_m: Some(0.275e-3),
    taught_radius_m: Some(0.275e-3),
    outer_radius_m: Some(10e-3),
    depth_exponent: None,
    fits_position_offset: false,
    is_position_controlled: false,
};

/// Experiments at the limits of formats §1: nothing measured, one constant pull, hardly any rows, any Poisson ratio, an
/// instrument far from the scales of a bead.
fn experiments() -> Vec<CharacteristicSizes> {
    let one_pull = CharacteristicSizes { hold_s: PORCINE.duration_s, ..PORCINE };
    let three_rows = CharacteristicSizes { sample_interval_s: 20.0, hold_s: 40.0, ..PORCINE };
    let two_rows = CharacteristicSizes { sample_interval_s: 40.0, hold_s: 40.0, ..PORCINE };
    let fast_switching = CharacteristicSizes { hold_s: 0.05, ..PORCINE };
    let indenter = CharacteristicSizes {
        largest_force_n: 1e-9,
        position_range_m: 3e-8,
        hold_s: 2e-3,
        cycle_s: 4e-3,
        sample_interval_s: 1e-5,
        duration_s: 0.5,
        poisson_ratio: None,
        robot_radius_m: None,
        taught_radius_m: None,
        outer_radius_m: None,
        depth_exponent: Some(1.5),
        fits_position_offset: false,
        is_position_controlled: false,
    };
    let gels = [0.499_999, 0.4999, 0.31, 0.3, 0.2, 0.0, -0.5, -0.999]
        .map(|ratio| CharacteristicSizes { poisson_ratio: Some(ratio), ..PORCINE });
    let unmeasured = CharacteristicSizes { position_range_m: 0.0, largest_force_n: 0.0, ..PORCINE };
    [PORCINE, one_pull, three_rows, two_rows, fast_switching, indenter, unmeasured].into_iter().chain(gels).collect()
}

/// Laws other than a series of Kelvin–Voigt bodies and a dashpot: a springpot, one beside a spring, Maxwell's fluid, and a network of all elements.
const SPRINGPOT: &str = r#"springpot = "mesh""#;
const SPRINGPOT_BESIDE_SPRING: &str = r#"parallel = [{ spring = "gel" }, { springpot = "mesh" }]"#;
const MAXWELL: &str = r#"series = [{ spring = "gel" }, { dashpot = "flow" }]"#;
const GENERALISED: &str = r#"series = [
    { parallel = [{ spring = "gel" }, { series = [{ spring = "arm" }, { dashpot = "slow" }] }, { dashpot = "fast" }] },
    { springpot = "flow" },
]"#;

fn network(text: &str) -> BaseLaw {
    BaseLaw::Network(vitreo_uq::laws::rheology::Network::from_text("network.toml".as_ref(), text).unwrap())
}

fn networks() -> [BaseLaw; 4] {
    [SPRINGPOT, SPRINGPOT_BESIDE_SPRING, MAXWELL, GENERALISED].map(network)
}

/// Effect that excludes a position-dependent force.
const LARGE: &str = "large-displacement";

fn parameters() -> impl Iterator<Item = &'static EffectParameter> {
    EFFECTS.iter().copied().flat_map(|effect| effect.parameters())
}

/// Model of one effect at unit parameters of the base law.
fn model(base: BaseLaw, effects: &[&'static dyn Effect], scales: CharacteristicSizes) -> Result<Model, Error> {
    Model::new(base, effects.to_vec(), scales, &InputPlace::setting(Setting::Effects))
}

/// The effect's parameters at the null; an unidentified one is set to its prior's median.
fn null_of(effect: &dyn Effect, scales: &CharacteristicSizes) -> Vec<f64> {
    let value = |p: &EffectParameter| (p.null)(scales).unwrap_or_else(|| (p.prior)(scales).quantile(0.5));
    effect.parameters().iter().map(value).collect()
}

fn stages_at(model: &Model, of_effects: &[f64]) -> Result<Stages, Error> {
    let n_law = model.base().parameters().len();
    let at = |spec: &vitreo_uq::base::parameter::ParameterSpec| if spec.support.contains(2.5) { 2.5 } else { 0.6 };
    let mut of_law: Vec<Dual> = model.base().parameters()[..n_law].iter().map(|spec| at(spec).into()).collect();
    // Unknowns of the experiment itself are at their null.
    of_law.resize(model.n_before_effects(), Dual::ZERO);
    let all: Vec<Dual> = of_law.into_iter().chain(of_effects.iter().map(|value| Dual::constant(*value))).collect();
    model.stages(&all)
}

fn effect(slug: &str) -> &'static dyn Effect {
    EFFECTS.iter().copied().find(|effect| effect.slug() == slug).unwrap()
}

/// The page lists exactly the library's effects, with stage and number of parameters, in the order of their application.
#[test]
fn the_library_is_the_one_that_the_page_on_physics_has() {
    let page = include_str!("../../docs/physics.md");
    let table = page.split("| effect | stage | parameters (null) | equation |").nth(1).expect("the table of effects");
    let rows = table.lines().skip(2).take_while(|line| line.starts_with('|'));
    let written: Vec<(String, String, usize)> = rows
        .map(|row| {
            let cells: Vec<&str> = row.split('|').map(str::trim).collect();
            (cells[1].trim_matches('`').to_string(), cells[2].to_string(), cells[3].split(", ").count())
        })
        .collect();
    let function = |effect: &&'static dyn Effect| {
        (effect.slug().to_string(), effect.stage().name().to_string(), effect.parameters().len())
    };
    assert_eq!(written, EFFECTS.iter().map(function).collect::<Vec<_>>());
}

#[test]
fn slugs_are_kebab_case_and_parameters_are_unique() {
    for &effect in EFFECTS {
        let slug = effect.slug();
        let is_word = |word: &str| !word.is_empty() && word.bytes().all(|byte| byte.is_ascii_lowercase());
        assert!(slug.split('-').all(is_word), "{slug}");
        assert!(!effect.parameters().is_empty(), "{slug}");
    }
    let mut names: Vec<&str> = parameters().map(|parameter| parameter.spec.name).collect();
    names.sort_unstable();
    assert!(names.windows(2).all(|pair| pair[0] != pair[1]), "{names:?}");
}

/// `1/m` becomes `_per_m`, `m/s` `_m_per_s`, `m²/(Pa s)` `_m2_per_pa_s`.
fn suffix(unit: &str) -> String {
    let plain = unit.replace(['(', ')'], "").replace('²', "2").replace(' ', "_").to_lowercase();
    match plain.split_once('/') {
        Some(("1", below)) => format!("_per_{below}"),
        Some((above, below)) => format!("_{above}_per_{below}"),
        None => format!("_{plain}"),
    }
}

#[test]
fn parameters_are_named_by_their_effect_and_end_in_their_unit() {
    for &effect in EFFECTS {
        for EffectParameter { spec, .. } in effect.parameters() {
            let name = spec.name.strip_prefix(effect.slug()).and_then(|rest| rest.strip_prefix('.')).unwrap();
            let is_letter = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'_';
            assert!(!name.is_empty() && name.bytes().all(is_letter), "{}", spec.name);
            let is_named = spec.unit != "1" && name.ends_with(&suffix(spec.unit)) && name != &suffix(spec.unit)[1..];
            let looks_like_a_unit = ["_s", "_m", "_pa", "_n"].iter().any(|unit| name.ends_with(unit));
            assert!(is_named || (spec.unit == "1" && !looks_like_a_unit), "{} in `{}`", spec.name, spec.unit);
        }
    }
}

#[test]
fn nothing_that_people_read_is_empty() {
    for &effect in EFFECTS {
        for text in [effect.description().summary, effect.description().equation] {
            assert!(text.len() > 5 && text.trim() == text && !text.ends_with('.'), "{}: `{text}`", effect.slug());
        }
        for parameter in effect.parameters() {
            assert!(!parameter.spec.symbol.is_empty(), "{}", parameter.spec.name);
            assert!(parameter.prior_source.starts_with("chosen: "), "{}", parameter.spec.name);
        }
    }
}

/// Returns `true` if all numbers of a distribution are finite, and positive and ordered as required.
fn is_proper(prior: Distribution) -> bool {
    let positive = |x: f64| x > 0.0 && x.is_finite();
    let ordered = |lower: f64, upper: f64| lower.is_finite() && upper.is_finite() && lower < upper;
    match prior {
        Distribution::LogNormal { median, log_sd } => positive(median) && positive(log_sd),
        Distribution::Normal { mean, sd } => mean.is_finite() && positive(sd),
        Distribution::HalfNormal { sd } => positive(sd),
        Distribution::Uniform { lower, upper } => ordered(lower, upper),
        Distribution::LogUniform { lower, upper } => positive(lower) && ordered(lower, upper),
        Distribution::Beta { alpha, beta, lower, upper } => positive(alpha) && positive(beta) && ordered(lower, upper),
    }
}

#[test]
fn priors_lie_inside_their_supports_for_any_experiment() {
    for scales in experiments() {
        for EffectParameter { spec, prior, .. } in parameters() {
            let prior = prior(&scales);
            assert!(is_proper(prior), "{}: {prior:?} at {scales:?}", spec.name);
            let (lower, upper) = prior.support();
            assert!(lower >= spec.support.lower && upper <= spec.support.upper, "{}: {prior:?}", spec.name);
            for p in [1e-9, 0.5, 1.0 - 1e-9] {
                let value = prior.quantile(p);
                assert!(value.is_finite() && spec.support.contains(value), "{}: {value} at {scales:?}", spec.name);
            }
        }
    }
}

#[test]
fn nulls_lie_where_the_prior_has_mass_nearby() {
    for scales in experiments() {
        for &effect in EFFECTS {
            if effect.needs_finite_elements() && scales.poisson_ratio.is_none() {
                continue;
            }
            let nulls: Vec<Option<f64>> = effect.parameters().iter().map(|p| (p.null)(&scales)).collect();
            assert!(nulls.iter().any(Option::is_some), "{} cannot be turned off", effect.slug());
            for (EffectParameter { spec, prior, .. }, null) in effect.parameters().iter().zip(nulls) {
                let Some(null) = null else { continue };
                assert!(spec.support.contains(null), "{}: {null}", spec.name);
                let density = prior(&scales).ln_pdf(null);
                assert!(density.is_finite(), "{}: {null} has no prior density at {scales:?}", spec.name);
                if let Some(step) = effect.finite_step(&scales) {
                    assert!(step != 0.0 && spec.support.contains(null + step), "{}: {step}", spec.name);
                }
            }
        }
    }
}

#[test]
fn at_its_null_every_effect_leaves_the_stages_as_they_are() {
    for scales in experiments() {
        for base in BaseLaw::NAMED.into_iter().chain(networks()) {
            let bare = stages_at(&model(base, &[], scales).unwrap(), &[]).unwrap();
            for &effect in EFFECTS {
                let Ok(model) = model(base, &[effect], scales) else { continue };
                let found = stages_at(&model, &null_of(effect, &scales)).unwrap();
                assert_eq!(found, bare, "{} on {base:?} at {scales:?}", effect.slug());
            }
        }
    }
}

/// Away from the null an effect writes something, and only in its stage.
#[test]
fn every_effect_writes_into_its_own_stage_only() {
    let bare = stages_at(&model(BaseLaw::Lethersich, &[], PORCINE).unwrap(), &[]).unwrap();
    for &effect in EFFECTS {
        let away: Vec<f64> = effect.parameters().iter().map(|p| (p.prior)(&PORCINE).quantile(0.8)).collect();
        let found = stages_at(&model(BaseLaw::Lethersich, &[effect], PORCINE).unwrap(), &away).unwrap();
        let mut expected = bare.clone();
        match effect.stage() {
            Stage::Load => expected.load = found.load.clone(),
            Stage::Mechanics => {
                expected.law = found.law.clone();
                expected.softening_rate_per_s = found.softening_rate_per_s;
                expected.poisson_ratio = found.poisson_ratio;
                expected.spatial = found.spatial.clone();
            }
            Stage::Observation => expected.observation = found.observation.clone(),
        }
        assert_eq!(found, expected, "{}", effect.slug());
        assert_ne!(found, bare, "{}", effect.slug());
    }
}

/// A parameter that moves at the null must reach the stages, or its sensitivity would be lost. An unidentified parameter, or one held beside another's null, must not.
#[test]
fn a_moving_null_reaches_the_stages() {
    let bare = stages_at(&model(BaseLaw::Lethersich, &[], PORCINE).unwrap(), &[]).unwrap();
    for &effect in EFFECTS {
        let model = model(BaseLaw::Lethersich, &[effect], PORCINE).unwrap();
        let null = null_of(effect, &PORCINE);
        for (j, parameter) in effect.parameters().iter().enumerate() {
            let mut all = vec![Dual::constant(2.5); 3];
            all.extend(null.iter().map(|value| Dual::constant(*value)));
            all[3 + j].derivative = 1.0;
            let is_same = model.stages(&all).unwrap() == bare;
            let means_nothing = (parameter.null)(&PORCINE).is_none() || parameter.spec.is_optional;
            assert_eq!(is_same, means_nothing, "{}", parameter.spec.name);
        }
    }
}

#[test]
fn parameters_outside_their_supports_are_refused_by_name() {
    for &effect in EFFECTS {
        let model = model(BaseLaw::Lethersich, &[effect], PORCINE).unwrap();
        for (j, EffectParameter { spec, .. }) in effect.parameters().iter().enumerate() {
            let ends = [(spec.support.lower, -1.0), (spec.support.upper, 1.0)];
            let beyond = ends.into_iter().filter(|(end, _)| end.is_finite()).map(|(end, side)| end + 1e-9 * side);
            for value in beyond.chain([f64::NAN]) {
                let mut values = null_of(effect, &PORCINE);
                values[j] = value;
                let error = stages_at(&model, &values).unwrap_err();
                assert!(matches!(error, Error::Numerical { .. }), "{error:?}");
                assert!(error.to_string().contains(spec.name), "{value}: {error}");
            }
        }
    }
}

/// The pairs that physics §5 refuses, and mass beside a spring in series, because of waves. All others are allowed.
#[test]
fn laws_and_effects_are_refused_exactly_where_physics_says() {
    let twice = "a second one would be redundant";
    let refused = [
        ("burgers", "instantaneous-elasticity", twice),
        ("two-element", "second-retardation", twice),
        ("burgers", "inertia", "waves"),
    ];
    for base in BaseLaw::NAMED {
        for &effect in EFFECTS {
            let outcome = model(base, &[effect], PORCINE);
            let expected = refused.iter().find(|(law, slug, _)| (*law, *slug) == (base.name(), effect.slug()));
            assert_eq!(outcome.is_err(), expected.is_some(), "{} on {}", effect.slug(), base.name());
            if let (Err(error), Some((.., reason))) = (outcome, expected) {
                let text = error.to_string();
                assert!(text.contains(effect.slug()) && text.contains(reason), "{text}");
            }
        }
    }
}

/// Effects that every law of springs, dashpots and springpots accepts, and the missing elements of the others: each refusal names the effect's requirement.
#[test]
fn any_law_takes_what_it_has_the_elements_for() {
    let (twice, dashpot, memory, body) = (
        "a second one would be redundant",
        "no dashpot",
        "springpot",
        "Kelvin–Voigt bodies, springs and one dashpot in series",
    );
    let of_nonlinear = |slug: &str| effect(slug).is_nonlinear() && slug != LARGE;
    let reason = |text: &str, slug: &str| match (text, slug) {
        (MAXWELL, "instantaneous-elasticity") => Some(twice),
        (SPRINGPOT | SPRINGPOT_BESIDE_SPRING, "fractional-damping") => Some(dashpot),
        (MAXWELL, "inertia") => Some("waves"),
        (MAXWELL, LARGE) => None,
        (SPRINGPOT | SPRINGPOT_BESIDE_SPRING | GENERALISED, "inertia" | LARGE) => Some(memory),
        (_, slug) if of_nonlinear(slug) => Some(body),
        _ => None,
    };
    for text in [SPRINGPOT, SPRINGPOT_BESIDE_SPRING, MAXWELL, GENERALISED] {
        for &effect in EFFECTS {
            let outcome = model(network(text), &[effect], PORCINE).map(|_| ()).map_err(|error| error.to_string());
            match (reason(text, effect.slug()), outcome) {
                (None, outcome) => assert_eq!(outcome, Ok(()), "{} on {text}", effect.slug()),
                (Some(reason), Err(error)) => {
                    assert!(error.contains(effect.slug()) && error.contains(reason), "{error}");
                }
                (Some(_), Ok(())) => panic!("{} on {text} is taken", effect.slug()),
            }
        }
    }
}

/// All pairs are allowed with these exceptions: two effects that change the field; an effect with a field for fixed coefficients beside `softening` or a springpot; mass beside a
/// spring in series; a nonlinear law beside any other mechanics.
#[test]
fn every_pair_of_effects_stands_together_and_takes_its_parameters_in_order() {
    let barred = |a: &str, b: &dyn Effect| {
        b.field().is_some()
            && (["softening", "fractional-damping"].contains(&a)
                || (a == "instantaneous-elasticity" && b.slug() == "inertia"))
    };
    for (i, first) in EFFECTS.iter().enumerate() {
        for second in &EFFECTS[i + 1..] {
            let slugs = (first.slug(), second.slug());
            let both_change_the_field = first.changes_field() && second.changes_field();
            let both_mechanics = first.stage() == Stage::Mechanics && second.stage() == Stage::Mechanics;
            let one_is_nonlinear = first.is_nonlinear() || second.is_nonlinear();
            let is_beside_large = |other: &dyn Effect| other.depends_on_position();
            let large_under_another_load =
                (slugs.0 == LARGE && is_beside_large(*second)) || (slugs.1 == LARGE && is_beside_large(*first));
            let must_be_refused =
                both_change_the_field || (both_mechanics && one_is_nonlinear) || large_under_another_load;
            if must_be_refused || barred(slugs.0, *second) || barred(slugs.1, *first) {
                let text = model(BaseLaw::Lethersich, &[*first, *second], PORCINE).unwrap_err().to_string();
                assert!(text.contains(slugs.0) && text.contains(slugs.1), "{slugs:?}: {text}");
                continue;
            }
            let pair = model(BaseLaw::Lethersich, &[*first, *second], PORCINE).unwrap();
            let values: Vec<f64> = (first.parameters().iter().chain(second.parameters()))
                .map(|parameter| (parameter.prior)(&PORCINE).quantile(0.7))
                .collect();
            let together = stages_at(&pair, &values).unwrap();
            let (of_first, of_second) = values.split_at(first.parameters().len());
            let reversed = model(BaseLaw::Lethersich, &[*second, *first], PORCINE).unwrap();
            let turned = stages_at(&reversed, &[of_second, of_first].concat()).unwrap();
            // The law's elements are in series, so their order does not matter.
            let sorted = |mut stages: Stages| {
                stages.law.sort_by_key(|element| format!("{element:?}"));
                stages
            };
            assert_eq!(sorted(together), sorted(turned), "{slugs:?}");
        }
    }
}

#[test]
fn instruments_take_all_but_what_needs_finite_elements() {
    let instrument = CharacteristicSizes { poisson_ratio: None, ..PORCINE };
    let bare = stages_at(&model(BaseLaw::Lethersich, &[], PORCINE).unwrap(), &[]).unwrap();
    for &effect in EFFECTS {
        let outcome = model(BaseLaw::Lethersich, &[effect], instrument);
        // Changes beside the law in space, or of the gel's compressibility, are visible in the stages.
        let away: Vec<f64> = effect.parameters().iter().map(|p| (p.prior)(&PORCINE).quantile(0.8)).collect();
        let found = stages_at(&model(BaseLaw::Lethersich, &[effect], PORCINE).unwrap(), &away).unwrap();
        let needs_a_field = found.spatial != bare.spatial || found.poisson_ratio != bare.poisson_ratio;
        let refusal = outcome.err().map(|error| error.to_string()).unwrap_or_default();
        let words = format!("`{}` needs finite elements, and an instrument has none", effect.slug());
        assert_eq!(refusal.contains(&words), needs_a_field, "{}: {refusal}", effect.slug());
        assert_eq!(refusal.is_empty(), !needs_a_field, "{}: {refusal}", effect.slug());
    }
}

/// Only series of Kelvin–Voigt bodies, springs and one dashpot can contain a nonlinear body. The message names the law that cannot.
#[test]
fn nonlinear_laws_refuse_networks_that_they_cannot_take_apart() {
    let read = |text: &str| {
        BaseLaw::Network(vitreo_uq::laws::rheology::Network::from_text("network.toml".as_ref(), text).unwrap())
    };
    let body = r#"{ parallel = [{ dashpot = "soft" }, { spring = "gel" }] }"#;
    let fractional = r#"{ parallel = [{ spring = "gel" }, { springpot = "mesh" }] }"#;
    let taken = read(&format!(r#"series = [{{ dashpot = "flow" }}, {body}, {{ spring = "glass" }}]"#));
    let refused = [
        format!("series = [{body}]"),
        r#"series = [{ spring = "gel" }, { dashpot = "flow" }]"#.into(),
        format!(r#"series = [{fractional}, {{ dashpot = "flow" }}]"#),
        format!(r#"series = [{body}, {{ dashpot = "flow" }}, {{ dashpot = "other" }}]"#),
    ]
    .map(|text| read(&text));
    for &effect in EFFECTS.iter().filter(|effect| effect.is_nonlinear() && effect.slug() != LARGE) {
        let slug = effect.slug();
        assert!(model(taken, &[effect], PORCINE).is_ok(), "{slug}");
        for law in refused {
            let text = model(law, &[effect], PORCINE).unwrap_err().to_string();
            assert!(text.contains(slug) && text.contains("one dashpot in series"), "{text}");
        }
    }
}

/// The order of the effects does not change their reference elements, in laws with and without a Kelvin–Voigt body.
#[test]
fn effects_of_the_law_mean_the_same_in_any_order() {
    let slugs = ["instantaneous-elasticity", "second-retardation", "fractional-damping"];
    let effect_values = [vec![0.3], vec![0.4, 6.0], vec![0.6]];
    let laws = [
        BaseLaw::Lethersich,
        network(SPRINGPOT_BESIDE_SPRING),
        network(SPRINGPOT),
        network(MAXWELL),
        network(GENERALISED),
    ];
    let mut n_compared = 0;
    for base in laws {
        for [i, j] in [[0, 1], [0, 2], [1, 2]] {
            let written = |order: [usize; 2]| {
                let model = model(base, &order.map(|k| effect(slugs[k])), PORCINE).ok()?;
                let stages = stages_at(&model, &order.map(|k| effect_values[k].clone()).concat()).unwrap();
                let mut law: Vec<String> = stages.law.iter().map(|element| format!("{element:?}")).collect();
                law.sort();
                Some(law)
            };
            let (one, other) = (written([i, j]), written([j, i]));
            assert_eq!(one, other, "{base:?}");
            n_compared += usize::from(one.is_some());
        }
    }
    assert_eq!(n_compared, 3 + 1 + 1 + 1 + 3);
}

/// E in the effects' equations is the first Kelvin–Voigt spring of the law, also with other elements.
#[test]
fn effects_refer_to_the_first_kelvin_voigt_spring() {
    let together = ["fractional-damping", "instantaneous-elasticity"].map(effect);
    let two_element = model(BaseLaw::TwoElement, &together, PORCINE).unwrap();
    let values = [4.0, 1.0, 40.0, 9.0, 70.0, 0.6, 0.3].map(Dual::constant);
    let law = two_element.stages(&values).unwrap().law;
    let text = format!("{:?}", law.last());
    assert!(text.contains("0.075"), "ratio/E = 0.3/4: {text}");
}
