//! Tests of log densities that may be coarse below a floor.

use super::*;
use base::error::InputPlace;
use laws::stages::{FieldStepper, ReducedField, SharedStepper, Stages};
use models::effects::Library;
use record::CharacteristicSizes;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering as Memory};

/// Stepper without excess that counts its calls. Its untrained stepper gives the same result and does not count.
#[derive(Debug, Default)]
struct Counting {
    calls: AtomicUsize,
    is_direct: bool,
}

impl FieldStepper for Counting {
    fn excess_m(&self, _: &Stages, _: f64, time_s: &[f64], _: Force<'_>) -> Result<Vec<f64>> {
        self.calls.fetch_add(1, Memory::Relaxed);
        Ok(vec![0.0; time_s.len()])
    }

    fn excess_dual_m(&self, _: &Stages, _: f64, time_s: &[f64], _: Force<'_>) -> Result<Vec<Dual>> {
        Ok(vec![Dual::ZERO; time_s.len()])
    }

    fn untrained(&self, _: &Stages, _: f64) -> Option<SharedStepper> {
        (!self.is_direct).then(|| SharedStepper(Arc::new(Self { is_direct: true, ..Self::default() })))
    }
}

/// Points far below their floors are not trained, the others are; both kinds may stand in one batch.
#[test]
fn only_points_that_may_be_accepted_are_trained() {
    let scales = CharacteristicSizes {
        sample_interval_s: 0.05,
        duration_s: 2.0,
        poisson_ratio: Some(0.48),
        robot_radius_m: Some(0.275e-3),
        outer_radius_m: Some(10e-3),
        ..CharacteristicSizes::default()
    };
    let library = Library::default();
    let effect = library.get("strain-stiffening").unwrap();
    let model = Model::new(BaseLaw::Lethersich, vec![effect], scales, &InputPlace::default()).unwrap();
    let of_effect = model.parameters()[3].name.to_string();
    let priors = PriorSet::named("porcine").expect("embedded");
    let fixed = BTreeMap::from([(of_effect, 0.1)]);
    let counting = Arc::new(Counting::default());
    let shared = SharedStepper(counting.clone());
    let compliance = Compliance::fixed(549.0).with_spread(move |_| Ok(Some(ReducedField::Stepped(shared.clone()))));
    let parts = PosteriorParts {
        model: &model,
        noise: NoiseModel::default(),
        compliance,
        trained: &[],
        priors: &priors,
        fixed: &fixed,
    };
    let time_s: Vec<f64> = (0..40).map(|i| 0.05 * f64::from(i)).collect();
    let (force_n, observed_m) = (vec![4.6e-6; 40], vec![Some(1e-5); 40]);
    let record =
        FittedRecord { time_s: &time_s, force: (&force_n).into(), recording: &[1; 40], observed_m: &observed_m };
    let posterior = ReducedPosterior::new(parts, record);

    let naturals = [[3.5, 1.4, 47.0, 4.0], [3.6, 1.4, 47.0, 4.0], [3.7, 1.4, 47.0, 4.0], [3.7, 1.4, 47.0, 5.0]];
    let at: Vec<Vec<f64>> = naturals.iter().map(|natural| priors.to_unconstrained(natural)).collect();
    let points: Vec<f64> = (0..4).flat_map(|d| at.iter().map(move |point| point[d])).collect();
    let mut exact = [0.0; 4];
    posterior.log_density(&points, &mut exact);
    // The last two points share a trajectory.
    assert_eq!(counting.calls.swap(0, Memory::Relaxed), 3);
    for (above, n_calls) in [
        ([2.0 * COARSE_NATS; 4], 0),
        ([0.5 * COARSE_NATS; 4], 3),
        ([2.0 * COARSE_NATS, 0.0, 2.0 * COARSE_NATS, -1.0], 2),
        ([f64::NAN, 2.0 * COARSE_NATS, 2.0 * COARSE_NATS, f64::NEG_INFINITY], 2),
    ] {
        let floors: Vec<f64> = exact.iter().zip(above).map(|(value, above)| value + above).collect();
        let mut found = [0.0; 4];
        posterior.log_density_above(&points, &floors, &mut found);
        assert_eq!(found, exact, "{above:?}");
        assert_eq!(counting.calls.swap(0, Memory::Relaxed), n_calls, "{above:?}");
    }
}
