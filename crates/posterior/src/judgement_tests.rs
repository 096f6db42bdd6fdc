use documents::posterior::WarningKind;
use laws::rheology::CreepCompliance;
use models::model::convolve_m;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use record::{NoiseOrigin, ReferenceNoise};

use super::*;
use crate::monitor::SilentMonitor;
use crate::replica::{TABLE_I, embedded};
use crate::study::ModelSpecification;

const COMPLIANCE_PER_M: f64 = 549.0;
const WHITE_UM: f64 = 1.0;

/// Warnings about the true law in the replica's protocol. Its record has white noise of 1 µm and, with correlation time `slow_s`, slow noise of `slow_um`.
fn warnings_of(slow_um: f64, slow_s: f64, noise: &[&str], values: &[f64], origin: NoiseOrigin) -> Vec<Warning> {
    let (mut experiment, _) = embedded().unwrap();
    let law = CreepCompliance::lethersich(&TABLE_I);
    let record = &mut experiment.record;
    let exact_m = convolve_m(COMPLIANCE_PER_M, &law, &record.time_s, &record.force_n);
    let mut rng = ChaCha8Rng::seed_from_u64(71);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    let mut slow = normal();
    for (row, x) in exact_m.iter().enumerate() {
        if row > 0 {
            let kept = (-(record.time_s[row] - record.time_s[row - 1]) / slow_s).exp();
            slow = kept * slow + (1.0 - kept * kept).sqrt() * normal();
        }
        record.position_m[row] = Some(x + 1e-6 * (WHITE_UM * normal() + slow_um * slow));
    }
    experiment.apparatus =
        record::Apparatus::Instrument { compliance_per_m: COMPLIANCE_PER_M, is_stress_strain: false };
    let names: Vec<String> = noise.iter().map(|name| name.to_string()).collect();
    let specification = ModelSpecification::default().with_options(None, &[], &names, None, &[]).unwrap();
    let problem = Problem::new(experiment, specification, None, &SilentMonitor).unwrap();
    let prediction = Prediction {
        position_m: &exact_m,
        columns_m: &[],
        noise: (problem.noise, values),
        learnt_noise_m: None,
        joint_p: None,
    };
    Judgement::of(&problem, &prediction, Some(ReferenceNoise { sd_m: 1e-6 * WHITE_UM, origin })).warnings()
}

const ESTIMATED: NoiseOrigin = NoiseOrigin::ShortLag { n_differences: 300 };

/// Slow noise of 12 µm above an estimate of 1 µm differs in every cycle, so that its size is no proof of a misfit. A model without slow noise is told of it.
#[test]
fn residuals_far_above_an_estimate_are_told_unless_the_noise_explains_them() {
    let told = warnings_of(12.0, 1.0, &["white"], &[12.0], ESTIMATED);
    assert_eq!(
        told.iter().map(|warning| warning.kind).collect::<Vec<_>>(),
        [WarningKind::SystematicResidual],
        "{told:?}"
    );
    assert!(told[0].text.contains("× the estimated noise of 1.00 µm"), "{told:?}");
    let explained = warnings_of(12.0, 1.0, &["white", "ou"], &[1.0, 12.0, 1.0], ESTIMATED);
    assert_eq!(explained, []);
}

/// White noise as large as its estimate is nothing to tell. Slow noise below it makes the intervals of a model without slow noise too narrow.
#[test]
fn slow_noise_below_the_estimate_is_a_pattern_unless_the_noise_explains_it() {
    assert_eq!(warnings_of(0.0, 1.0, &["white"], &[1.0], ESTIMATED), []);
    let told = warnings_of(0.8, 1.0, &["white"], &[1.3], ESTIMATED);
    assert_eq!(told.iter().map(|warning| warning.kind).collect::<Vec<_>>(), [WarningKind::ResidualPattern], "{told:?}");
    assert_eq!(warnings_of(0.8, 1.0, &["white", "ou"], &[1.0, 0.8, 1.0], ESTIMATED), []);
}

/// A given noise limits the size of slow noise, so that a misfit is claimed.
#[test]
fn residuals_far_above_a_given_noise_are_a_misfit() {
    let told = warnings_of(12.0, 1.0, &["white"], &[12.0], NoiseOrigin::Known);
    assert_eq!(
        told.iter().map(|warning| warning.kind).collect::<Vec<_>>(),
        [WarningKind::MisfitAboveNoise],
        "{told:?}"
    );
}
