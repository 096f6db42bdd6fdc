//! Compares bands of learnt functions with the scatter of functions learnt from many records of one truth.

use super::*;
use crate::pairs::pairs;
use crate::smooth::N_WEIGHTS;
use crate::test_subjects::{Protocol, noise_of, subject, truth_of};
use criticism::refit::Refitted;
use criticism::{NoiseValues, Search};

/// Number of records, and number of records whose function is averaged over priors (`N_AVERAGED`).
const N_RECORDS: u64 = 48;
const N_AVERAGED: u64 = 16;
/// Weights of the true ln c₂ as a function of the path: first that of the trend, then those of the cosines.
const WEIGHTS: [f64; N_WEIGHTS] = [0.5, 0.15, -0.05, 0.0, 0.0, 0.0, 0.0, 0.0];

/// Mean and standard deviation of the ln factor at every setting, a pair of a state and a reference.
type Told = Vec<[f64; 2]>;

/// The 90 % bands of 48 records with white noise of 4 µm contain the truth as often as they should. Their width equals the scatter of the learnt functions. If a band
/// contains the truth with a probability of 0.9, fewer than 34 of 48 do so for 2 of 10⁵ seeds. The standard deviation of 48 standard normal values is 1 ± 0.1 and is off
/// by more than 0.4 in 1 of 10⁴. Bands averaged over priors also contain the truth; this is tested in 16 of the records. Fewer than 10 of 16 occur in 7 of 10⁵ seeds, for
/// each of four ratios. The weights of the priors sum to one, and a formula's derivatives equal differences.
#[test]
#[ignore = "thorough"]
fn bands_are_as_wide_as_what_is_learnt_scatters() {
    let subject = subject(Protocol::Levels).with_cycles(&[1, 2, 3, 4], &[5]).unwrap();
    let start = subject.fit(&subject.base(), &[], Search::Wide).unwrap();
    let base = Refitted { candidate: subject.base(), fitted: start, future: None };
    let pairs = pairs(&subject, &base, false).unwrap();
    let pair = pairs.iter().find(|pair| (pair.quantity, pair.state) == ("viscosity_2_pa_s", "path")).unwrap();
    let library = subject.library().clone().with_all([pair.effect]);
    let subject = subject.with_library(&library).unwrap();
    let candidate = subject.extended(&[pair.effect.slug()]).unwrap();
    let truth_m = truth_of(&subject, &[pair.effect.slug()], &WEIGHTS);
    let StateKind::Function { smooth, visited, .. } = &pair.kind else { panic!("a function") };
    let far = visited.iter().fold(0.0_f64, |far, s| far.max(*s));
    let states = [0.3, 0.6].map(|part| part * far);
    let ln_factor = |state: f64| {
        let functions = smooth.functions(state.into());
        WEIGHTS.iter().zip(functions).map(|(weight, function)| weight * function.value).sum::<f64>()
    };
    // Ratios to the value at the state 0, and to the value near the middle of the states.
    let settings = [0.0, 0.45].map(|part| part * far).map(|reference| states.map(|state| (state, reference)));
    let settings = settings.concat();
    let noise: NoiseValues = NoiseValues::new([4.0, 0.0, 1.0, 0.0, 0.0]);
    let curves = (0..N_RECORDS).into_par_iter().map(|seed| {
        let noise_m = noise_of(&subject, &truth_m, &noise, 900 + seed);
        let data = subject.with_positions(&truth_m.iter().zip(noise_m).map(|(x, e)| x + e).collect::<Vec<_>>());
        let start = (base.fitted.theta.clone(), base.fitted.noise);
        let start = (candidate.embed(&base.candidate, &start.0), start.1);
        let (candidate, fitted, evidence_nats) = fit_spread(&data, &candidate, 1.0, start).unwrap();
        let learnt = PairFit { pair: 0, candidate, fitted, evidence_nats, future: None };
        let function = Function::of_search(&data, &learnt, pair).unwrap().unwrap();
        let visited = NoiseValues::new([0.0, 0.15, 0.3, 0.45, 0.6]).map(|part| part * far);
        let best = function.best_known(&visited).unwrap();
        let variance =
            |reference: f64| -> f64 { function.curve(&visited, reference).iter().map(|[_, sd]| sd * sd).sum() };
        assert!(best > 0.0 && visited.iter().all(|state| variance(best) <= variance(*state)), "{best}");
        let told = |function: &Function| -> Told {
            settings.iter().map(|(state, reference)| function.curve(&[*state], *reference)[0]).collect()
        };
        let averaged = (seed < N_AVERAGED).then(|| {
            let mut averaged = Function::averaged(&data, &learnt, pair).unwrap().unwrap();
            assert!((averaged.members.iter().map(|member| member.share).sum::<f64>() - 1.0).abs() < 1e-12);
            let told = told(&averaged);
            averaged.members.iter_mut().for_each(|member| slopes_are_differences(member, settings[0].0));
            told
        });
        (told(&function), averaged)
    });
    let (curves, averaged): (Vec<Told>, Vec<Option<Told>>) = curves.unzip();
    let averaged: Vec<Told> = averaged.into_iter().flatten().collect();
    for (k, (state, reference)) in settings.iter().enumerate() {
        let truth = ln_factor(*state) - ln_factor(*reference);
        let n = curves.len() as f64;
        let mean = curves.iter().map(|curve| curve[k][0]).sum::<f64>() / n;
        let scatter = (curves.iter().map(|curve| (curve[k][0] - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
        let band = curves.iter().map(|curve| curve[k][1]).sum::<f64>() / n;
        assert!((0.6..1.4).contains(&(scatter / band)), "scatter {scatter}, band {band}");
        let covered = curves.iter().filter(|curve| (curve[k][0] - truth).abs() <= 1.645 * curve[k][1]).count();
        assert!(covered >= 34, "{covered} of {N_RECORDS} hold {truth}: mean {mean} ± {band}");
        let covered = averaged.iter().filter(|curve| (curve[k][0] - truth).abs() <= 1.645 * curve[k][1]).count();
        let widest = averaged.iter().map(|curve| curve[k][1]).fold(0.0, f64::max);
        assert!(
            covered >= 10 && widest < 5.0 * band,
            "averaged: {covered} hold {truth}, at most ± {widest} beside {band}"
        );
    }
}

fn slopes_are_differences(member: &mut FunctionFit, state: f64) {
    if matches!(member.shape, FunctionShape::Smooth(_)) {
        return;
    }
    for (k, slope) in member.ln_factor(state).1 {
        let (theta, h) = (member.fitted.theta[k], 1e-5);
        let [below, above] = [-h, h].map(|h| {
            member.fitted.theta[k] = theta + h;
            member.ln_factor(state).0
        });
        member.fitted.theta[k] = theta;
        let difference = (above - below) / (2.0 * h);
        assert!((slope - difference).abs() < 1e-6 + 1e-4 * slope.abs(), "{slope} {difference}");
    }
}
