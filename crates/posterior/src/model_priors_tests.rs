use super::*;
use crate::replica::embedded;
use base::distribution::Distribution;
use base::error::InputPlace;
use models::effects::EFFECTS;

fn model(base: BaseLaw, effects: &[&str]) -> Model {
    let library = Library::default();
    let effects = effects.iter().map(|slug| library.get(slug).unwrap()).collect();
    Model::new(base, effects, embedded().unwrap().0.scales(), &InputPlace::default()).unwrap()
}

fn priors(name_or_file: &str, model: &Model, noise: &[&str]) -> PriorSet {
    let noise: Vec<String> = noise.iter().map(|name| name.to_string()).collect();
    let noise = NoiseModel::named(&noise, &InputPlace::default()).unwrap();
    read_priors(name_or_file, model, noise, &Library::default()).unwrap()
}

fn median(priors: &PriorSet, name: &str) -> f64 {
    priors.get(name).unwrap().distribution.quantile(0.5)
}

/// The median of the white noise is 4 µm in the porcine prior and 1 µm in the generic prior. The process's standard deviation has half of this median.
#[test]
fn the_noise_s_priors_follow_the_white_noise_s_and_the_record() {
    for (name, noise_um) in [("porcine", 4.0), ("generic", 1.0)] {
        let priors = priors(name, &model(BaseLaw::Lethersich, &[]), &["white", "ou", "gain"]);
        assert!((median(&priors, "noise_sd_um") / noise_um - 1.0).abs() < 1e-9);
        assert!((median(&priors, "ou_sd_um") / (0.5 * noise_um) - 1.0).abs() < 1e-9);
        let distribution = |name: &str| priors.get(name).unwrap().distribution;
        assert_eq!(distribution("gain_sd"), Distribution::HalfNormal { sd: 0.03 });
        let Distribution::HalfNormal { sd } = distribution("offset_sd_um") else { panic!("a half-normal") };
        assert!((sd / noise_um - 1.0).abs() < 1e-9);
        // The replica has rows 0.05 s apart and cycles of 10 s, of which the last row's interval is not observed.
        let time_s = distribution("ou_time_s");
        assert!((time_s.quantile(0.0) / 0.1 - 1.0).abs() < 1e-6, "{time_s:?}");
        assert!((time_s.quantile(1.0) / 10.0 - 1.0).abs() < 2e-3, "{time_s:?}");
    }
}

#[test]
fn what_a_law_adds_follows_the_prior_of_the_base() {
    for name in ["porcine", "generic", "lee-1994"] {
        let base = PriorSet::named(name).unwrap();
        let burgers = priors(name, &model(BaseLaw::Burgers, &[]), &["white"]);
        let ratio = median(&burgers, "instantaneous_modulus_pa") / median(&base, "young_modulus_pa");
        assert!((ratio / 10.0 - 1.0).abs() < 1e-9, "{name}: {ratio}");
        let two = priors(name, &model(BaseLaw::TwoElement, &[]), &["white"]);
        let ratio = |name: &str, of: &str| median(&two, name) / median(&base, of);
        assert!((ratio("second_modulus_pa", "young_modulus_pa") - 1.0).abs() < 1e-9);
        assert!((ratio("second_viscosity_pa_s", "viscosity_1_pa_s") / 10.0 - 1.0).abs() < 1e-9);
        for spec in BaseLaw::Lethersich.parameters() {
            assert_eq!(two.get(spec.name), base.get(spec.name));
        }
    }
}

#[test]
fn effects_bring_their_own_priors() {
    for effect in EFFECTS {
        let model = model(BaseLaw::Lethersich, &[effect.slug()]);
        let priors = priors("porcine", &model, &["white"]);
        assert_eq!(priors.priors().len(), 4 + effect.parameters().len());
        for parameter in effect.parameters() {
            let found = priors.get(parameter.spec.name).unwrap();
            assert_eq!(found.distribution, (parameter.prior)(model.scales()));
            assert_eq!((&*found.unit, &*found.source), (parameter.spec.unit, parameter.prior_source));
        }
    }
}

/// A table of a prior file replaces the default prior of its parameter. It is ignored if the model has no such parameter. All other parameters keep their defaults.
#[test]
fn a_file_s_table_replaces_the_default() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("own.toml");
    let label = "\n[\"tracking-drift.velocity_m_per_s\"]\ndistribution = \"normal\"\nmean = 1e-6\nsd = 3e-7\nunit = \"m/s\"\nsource = \"a stage\"\n\
               \n[ou_sd_um]\ndistribution = \"half_normal\"\nsd = 7.0\nunit = \"um\"\nsource = \"a stage\"\n";
    std::fs::write(&file, [PriorSet::named("porcine").unwrap().text(), label].concat()).unwrap();
    let path = file.to_str().unwrap();
    let both = model(BaseLaw::Lethersich, &["force-asymmetry", "tracking-drift"]);
    let (with, without) =
        (priors(path, &both, &["white", "ou"]), priors(path, &model(BaseLaw::Lethersich, &[]), &["white"]));
    let drift = with.get("tracking-drift.velocity_m_per_s").unwrap();
    assert_eq!(drift.distribution, Distribution::Normal { mean: 1e-6, sd: 3e-7 });
    assert_eq!(drift.source, "a stage");
    assert_eq!(with.get("ou_sd_um").unwrap().distribution, Distribution::HalfNormal { sd: 7.0 });
    let default = priors("porcine", &both, &["white", "ou"]);
    for name in ["force-asymmetry.fraction", "ou_time_s", "young_modulus_pa"] {
        assert_eq!(with.get(name), default.get(name));
    }
    assert_eq!(without.names().collect::<Vec<_>>(), PriorSet::named("porcine").unwrap().names().collect::<Vec<_>>());
}
