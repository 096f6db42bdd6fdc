//! Every law, network, effect and noise that `sample` accepts passes through the comparison: small cohorts, short closed-form records, few steps. The
//! tests check that all figures are numbers and every parameter is inside its support.

use std::path::PathBuf;
use std::sync::OnceLock;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use vitreo_uq::base::parameter::ParameterSpec;
use vitreo_uq::base::sha256::sha256_hex;
use vitreo_uq::cohorts::artefacts;
use vitreo_uq::cohorts::cohort::{Key, Measurement};
use vitreo_uq::cohorts::job::{GroupsRequest, run_with};
use vitreo_uq::cohorts::summary::summarise;
use vitreo_uq::documents::groups::GroupsSummary;
use vitreo_uq::elements::fe::Stiffness;
use vitreo_uq::elements::fe::spatial::{GelAndRobot, PhysicalProperties};
use vitreo_uq::elements::fe::time::FullOrderModel;
use vitreo_uq::elements::mesh::{Mesh, QuarterBall};
use vitreo_uq::laws::rheology::{BaseLaw, Network};
use vitreo_uq::models::effects::{EFFECTS, Effect};
use vitreo_uq::models::model::{Compliance, TrainedRange};
use vitreo_uq::models::surrogate::{FieldModels, Surrogate, Training};
use vitreo_uq::posterior::monitor::SilentMonitor;
use vitreo_uq::posterior::study::ModelSpecification;
use vitreo_uq::record::Experiment;
use vitreo_uq::sampling::SamplerOptions;

/// Displacement per force at unit creep compliance, in 1/m; about that of the sphere below.
const COMPLIANCE_PER_M: f64 = 549.178;
const FORCE_N: f64 = 4.6e-6;
const ROWS_A_HOLD: usize = 12;
const INTERVAL_S: f64 = 0.4;
const POISSON_RATIO: f64 = 0.48;

#[derive(Clone, Copy, PartialEq)]
enum Apparatus {
    Instrument,
    Robot,
}

/// J(t) in 1/Pa.
type Creep = fn(f64, f64) -> f64;

/// Creep of the Lethersich law, with all moduli and viscosities multiplied by a factor.
fn lethersich(time_s: f64, factor: f64) -> f64 {
    ((1.0 - (-3.527 * time_s / 1.402_f64).exp()) / 3.527 + time_s / 47.370) / factor
}

/// Creep of a springpot with nearly a dashpot's order.
fn springpot(time_s: f64, factor: f64) -> f64 {
    let order = 0.95 - 0.02 * (factor - 1.0);
    time_s.powf(order) / (20.0 * factor * statrs::function::gamma::gamma(1.0 + order))
}

/// Three species-and-specimen pairs, one of them measured twice: two cycles of ±F each.
fn cohort(specification: &ModelSpecification, apparatus: Apparatus, creep: Creep) -> Vec<Measurement> {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let eyes = [("bovine", "a", 2.0), ("bovine", "b", 1.6), ("porcine", "c", 1.0), ("porcine", "c", 1.05)];
    let one = |(index, (species, id, factor)): (usize, (&str, &str, f64))| {
        let mut csv = String::from("time_s,force_uN,position_um,cycle\n");
        for row in 0..4 * ROWS_A_HOLD {
            let (time_s, hold) = (INTERVAL_S * row as f64, row / ROWS_A_HOLD);
            let sign = |hold: usize| if hold.is_multiple_of(2) { 1.0 } else { -1.0 };
            let step_m = |h: usize| {
                let since_s = time_s - INTERVAL_S * (h * ROWS_A_HOLD) as f64;
                let step = if h == 0 { 1.0 } else { 2.0 * sign(h) };
                if since_s > 0.0 { step * FORCE_N * COMPLIANCE_PER_M * creep(since_s, factor) } else { 0.0 }
            };
            let noise: f64 = StandardNormal.sample(&mut rng);
            let position_um = 1e6 * (0..=hold).map(step_m).sum::<f64>() + 4.0 * noise;
            csv += &format!("{time_s:.6},{:.1},{position_um:.4},{}\n", 1e6 * FORCE_N * sign(hold), 1 + hold / 2);
        }
        let of = match apparatus {
            Apparatus::Instrument => format!("[instrument]\ncompliance_per_m = {COMPLIANCE_PER_M}\n"),
            Apparatus::Robot => format!(
                "[robot]\nshape = \"sphere\"\ndiameter_mm = 0.55\ndensity_kg_m3 = 7500\n\
                 [vitreous]\ndiameter_mm = 20.0\npoisson_ratio = {POISSON_RATIO}\ndensity_kg_m3 = 1000\n"
            ),
        };
        let toml = format!(
            "[specimen]\nid = \"{id}\"\nspecies = \"{species}\"\n{of}\
             [measurement]\nfile = \"trajectory.csv\"\nnoise_um = 4.0\nsource = \"synthetic: closed form\"\n"
        );
        let (experiment, _) = Experiment::from_texts("experiment.toml", &toml, "trajectory.csv", &csv).unwrap();
        Measurement {
            path: PathBuf::from(format!("{species}-{id}-{index}")),
            experiment,
            inputs_sha256: sha256_hex(format!("{toml}{csv}").as_bytes()),
            specification: specification.clone(),
        }
    };
    eyes.into_iter().enumerate().map(one).collect()
}

/// Runs a comparison and writes its files.
fn compared(
    specification: &ModelSpecification,
    apparatus: Apparatus,
    creep: Creep,
    compliance: Compliance,
) -> GroupsSummary {
    let dir = tempfile::tempdir().unwrap();
    let measurements = cohort(specification, apparatus, creep);
    let sampler = SamplerOptions { n_walkers: 20, max_steps: 600, ..SamplerOptions::default() };
    let request = GroupsRequest {
        keys: &[Key::Species],
        margin: 0.2,
        is_heavy_tailed: false,
        sampler,
        n_chains: 2,
        max_sweeps: 400,
        is_exact: false,
        kept: &dir.path().join("experiments"),
    };
    let what = format!("{} {:?} {:?}", specification.base.name(), specification.effects, specification.noise);
    let found = run_with(&measurements, vec![compliance; measurements.len()], &request, &SilentMonitor)
        .unwrap_or_else(|error| panic!("{what}: {error}"));
    let summary = summarise(&measurements, &found, &request).unwrap_or_else(|error| panic!("{what}: {error}"));
    let provenance = artefacts::provenance_of("groups", &measurements, 1);
    artefacts::write(dir.path(), request.keys, &found, &summary, provenance)
        .unwrap_or_else(|error| panic!("{what}: {error}"));
    check(&summary, specification.base.parameters(), &what);
    summary
}

/// Asserts that all figures are numbers, in order and inside the supports.
fn check(summary: &GroupsSummary, law: &[ParameterSpec], what: &str) {
    let inside = |name: &str, values: &[f64]| {
        let spec = law.iter().find(|spec| spec.name == name).unwrap();
        let is_inside = values.is_sorted() && values.iter().all(|x| x.is_finite() && spec.support.contains(*x));
        assert!(is_inside, "{what}, {name}: {values:?}");
    };
    for parameter in summary.groups.iter().flat_map(|group| &group.parameters) {
        inside(&parameter.name, &[parameter.q05, parameter.median, parameter.q95]);
        inside(&parameter.name, &parameter.new_specimen_90);
        assert!(parameter.between_specimen_log_sd > 0.0, "{what}: {parameter:?}");
    }
    for parameter in summary.specimens.iter().flat_map(|specimen| &specimen.parameters) {
        inside(&parameter.name, &parameter.alone);
        inside(&parameter.name, &parameter.pooled);
    }
    for contrast_summary in &summary.contrasts {
        assert!(
            contrast_summary.q05 > 0.0
                && contrast_summary.q05 <= contrast_summary.q95
                && contrast_summary.q95.is_finite(),
            "{what}: {contrast_summary:?}"
        );
    }
    let creep = summary.creep.as_ref().unwrap_or_else(|| panic!("{what}: no creep"));
    assert_eq!(creep.groups.len(), 2, "{what}");
}

fn network(text: &str) -> BaseLaw {
    BaseLaw::Network(Network::from_text("network.toml".as_ref(), text).unwrap())
}

fn of_law(base: BaseLaw) -> ModelSpecification {
    ModelSpecification { base, ..ModelSpecification::default() }
}

const NETWORKS: [&str; 5] = [
    "springpot = \"gel\"",
    "parallel = [{ spring = \"gel\" }, { springpot = \"mesh\" }]",
    "series = [{ parallel = [{ spring = \"gel\" }, { springpot = \"mesh\" }] }, { dashpot = \"flow\" }]",
    "parallel = [{ springpot = \"fast\" }, { springpot = \"slow\" }]",
    "parallel = [{ dashpot = \"solvent\" }, { series = [{ spring = \"gel\" }, { dashpot = \"chain\" }] }]",
];

fn compared_by_instruments(specification: &ModelSpecification) {
    compared(specification, Apparatus::Instrument, lethersich, Compliance::fixed(COMPLIANCE_PER_M));
}

#[test]
fn a_law_and_a_network_go_through() {
    for base in [BaseLaw::Lethersich, network(NETWORKS[1])] {
        compared_by_instruments(&of_law(base));
    }
}

#[test]
#[ignore = "campaigns/long-tests"]
fn every_law_and_network_goes_through() {
    for base in BaseLaw::NAMED.into_iter().chain(NETWORKS.map(network)) {
        compared_by_instruments(&of_law(base));
    }
}

/// Orders near the end of their support, where a logarithm would leave it. New specimens and curves stay inside, and ratios are of orders.
#[test]
fn an_order_near_one_stays_an_order() {
    let law = network("springpot = \"gel\"");
    let summary = compared(&of_law(law), Apparatus::Instrument, springpot, Compliance::fixed(COMPLIANCE_PER_M));
    let order = |name: &str| {
        let group = summary.groups.iter().find(|group| group.name == name).unwrap();
        group.parameters.iter().find(|parameter| parameter.name == "gel_order").unwrap().clone()
    };
    for name in ["bovine", "porcine"] {
        let group_parameter = order(name);
        assert!(
            group_parameter.q05 < 0.95 && 0.9 < group_parameter.q95 && group_parameter.new_specimen_90[1] < 1.0,
            "{group_parameter:?}"
        );
    }
    let ratio = summary.contrasts.iter().find(|contrast| contrast.parameter == "gel_order").unwrap();
    let of_medians = order("bovine").median / order("porcine").median;
    assert!((ratio.ratio_median / of_medians).ln().abs() < 0.05, "{ratio:?} {of_medians}");
    assert!(ratio.q95 < 2.0, "an order is at most 1: {ratio:?}");
}

fn of_noise(noise: &[&str]) -> ModelSpecification {
    ModelSpecification { noise: noise.iter().map(ToString::to_string).collect(), ..ModelSpecification::default() }
}

fn of_effect(slug: &str) -> ModelSpecification {
    ModelSpecification { effects: vec![slug.to_string()], ..ModelSpecification::default() }
}

#[test]
fn all_noise_at_once_and_an_effect_of_an_instrument_go_through() {
    compared_by_instruments(&of_noise(&["white", "ou", "gain", "student"]));
    compared_by_instruments(&of_effect("softening"));
}

#[test]
#[ignore = "campaigns/long-tests"]
fn every_noise_and_every_effect_of_an_instrument_goes_through() {
    for noise in [&["white", "ou"][..], &["white", "gain"], &["white", "student"], &["white", "ou", "gain", "student"]]
    {
        compared_by_instruments(&of_noise(noise));
    }
    for effect in EFFECTS.iter().filter(|effect| !effect.needs_finite_elements()) {
        compared_by_instruments(&of_effect(effect.slug()));
    }
}

/// A coarse mesh, because only the completion of the comparison is tested, not its accuracy.
const BALL: QuarterBall = QuarterBall { robot_radius_m: 0.275e-3, outer_radius_m: 10e-3, n_per_edge: 1, n_layers: 4 };

fn surroundings(is_nonlinear: bool) -> GelAndRobot<'static> {
    static MESH: OnceLock<(Mesh, Stiffness)> = OnceLock::new();
    let (mesh, stiffness) = MESH.get_or_init(|| {
        let mesh = BALL.mesh().unwrap();
        let stiffness = Stiffness::new(&mesh).unwrap();
        (mesh, stiffness)
    });
    let robot_mass_kg = 7500.0 * 4.0 / 3.0 * std::f64::consts::PI * BALL.robot_radius_m.powi(3);
    let sizes = PhysicalProperties {
        gel_density_kg_m3: 1000.0,
        robot_mass_kg,
        robot_radius_m: BALL.robot_radius_m,
        outer_radius_m: BALL.outer_radius_m,
        // A thinning law would bring a finer mesh of its own.
        ball: (!is_nonlinear).then_some(BALL),
    };
    GelAndRobot { mesh, stiffness, poisson_ratio: POISSON_RATIO, sizes }
}

/// Compliance over the effects' Poisson ratios.
fn family() -> Compliance {
    static SURROGATE: OnceLock<Surrogate> = OnceLock::new();
    let surrogate = SURROGATE.get_or_init(|| {
        let range =
            |parameter_spec: &ParameterSpec| TrainedRange { name: parameter_spec.name.into(), lower: 1.0, upper: 9.0 };
        let parameters: Vec<TrainedRange> = BaseLaw::Lethersich.parameters().iter().map(range).collect();
        let time_s: Vec<f64> = (0..4 * ROWS_A_HOLD).map(|row| INTERVAL_S * row as f64).collect();
        let force_n = vec![FORCE_N; time_s.len()];
        let training = Training {
            law: BaseLaw::Lethersich,
            parameters: &parameters,
            poisson_ratio: [0.0, 0.499],
            time_s: &time_s,
            force: (&force_n).into(),
            tolerance: 1e-6,
        };
        Surrogate::train(surroundings(false).stiffness, &training).unwrap()
    });
    surrogate.compliance(POISSON_RATIO).unwrap()
}

fn assert_field_effects_go_through(is_asked: fn(&dyn Effect) -> bool) {
    for effect in EFFECTS.iter().filter(|effect| effect.needs_finite_elements() && is_asked(**effect)) {
        let fields = FieldModels::build(*effect, &surroundings(effect.is_nonlinear()), &|| ()).unwrap();
        let compliance = if effect.is_nonlinear() {
            let full = FullOrderModel::new(surroundings(true).stiffness, POISSON_RATIO).unwrap();
            Compliance::fixed(full.compliance_per_m())
        } else {
            family()
        };
        let compliance = compliance.with_spread(move |stages| fields.spread(stages));
        compared(&of_effect(effect.slug()), Apparatus::Robot, lethersich, compliance);
    }
}

#[test]
fn an_effect_of_the_displacement_field_goes_through() {
    assert_field_effects_go_through(|effect| effect.slug() == "interface-slip");
}

/// One nonlinear law represents three: `groups` uses the same stepper for all, and each takes minutes.
#[test]
#[ignore = "campaigns/long-tests"]
fn effects_of_the_displacement_field_go_through() {
    assert_field_effects_go_through(|effect| !effect.is_nonlinear() || effect.slug() == "strain-stiffening");
}
