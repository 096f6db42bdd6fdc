//! The committed synthetic cohort equals the output of `examples/make_cohort`, and its README states the settings.

#[path = "../../examples/make_cohort/cohort.rs"]
mod cohort;

use std::path::{Path, PathBuf};

use rand::SeedableRng;
use vitreo_uq::elements::fe::time::TimeScheme;
use vitreo_uq::record::Apparatus;

fn directory() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data/cohort")
}

fn committed(file: &str) -> String {
    std::fs::read_to_string(directory().join(file)).unwrap_or_else(|error| panic!("{file}: {error}"))
}

/// Asserts that fields are equal as texts, or as numbers within one unit of the last printed digit.
fn assert_same_table(name: &str, made: &str, committed: &str, unit: f64) {
    assert_eq!(made.lines().count(), committed.lines().count(), "{name}: rows");
    for (made, committed) in made.lines().zip(committed.lines()) {
        assert_eq!(made.split(',').count(), committed.split(',').count(), "{name}: {made} against {committed}");
        for (a, b) in made.split(',').zip(committed.split(',')) {
            let close = |a: f64, b: f64| (a - b).abs() < 1.5 * unit;
            let same = a == b || matches!((a.parse(), b.parse()), (Ok(a), Ok(b)) if close(a, b));
            assert!(same, "{name}: {made} against {committed}");
        }
    }
}

#[test]
fn the_truth_and_every_description_are_what_the_code_makes() {
    let experiments = cohort::experiments();
    assert_same_table("truth.csv", &cohort::truth_csv(&experiments), &committed("truth.csv"), 1e-6);
    for experiment in &experiments {
        assert_eq!(experiment.toml(), committed(&format!("{}/experiment.toml", experiment.name)));
    }
    let entries = std::fs::read_dir(directory()).unwrap().map(|entry| entry.unwrap().path());
    assert_eq!(entries.filter(|path| path.is_dir()).count(), experiments.len(), "directories of data/cohort");
}

/// All trajectories are reproduced. In every experiment the time steps' error is below a fiftieth of the noise, by the exact step.
#[test]
#[ignore = "thorough"]
fn trajectories_are_what_full_finite_elements_make() {
    let experiments = cohort::experiments();
    for species in &cohort::SPECIES {
        let stiffness = species.stiffness().unwrap();
        let model = cohort::model(&stiffness).unwrap();
        for experiment in experiments.iter().filter(|experiment| experiment.species.name == species.name) {
            let exact = experiment.positions_um(&model, TimeScheme::Exponential);
            let stepped = experiment.positions_um(&model, TimeScheme::Midpoint);
            let error_um = exact.iter().zip(&stepped).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(error_um < 0.02 * experiment.noise_um, "{}: {error_um} µm", experiment.name);
            let file = format!("{}/trajectory.csv", experiment.name);
            assert_same_table(&file, &experiment.trajectory_csv(&model), &committed(&file), 1e-2);
        }
    }
}

/// The program reads every experiment: labelled, of this apparatus, with the missing parts that the note names.
#[test]
fn every_experiment_is_read_and_says_that_it_is_synthetic() {
    for experiment in cohort::experiments() {
        let (read, files) = vitreo_uq::record::Experiment::read(&directory().join(&experiment.name)).unwrap();
        assert!(files.toml_bytes.starts_with(b"# SYNTHETIC") && read.source.starts_with("SYNTHETIC"));
        assert_eq!((&read.specimen_id, read.species.as_deref()), (&experiment.specimen, Some(experiment.species.name)));
        assert_eq!(read.region.as_deref(), Some(experiment.region));
        let (robot, vitreous) = experiment.species.apparatus();
        assert_eq!(read.apparatus, Apparatus::Robot { robot, vitreous });
        assert!((1e6 * read.noise_sd_m.unwrap() - experiment.noise_um).abs() < 1e-9);
        let n_lost = read.record.position_m.iter().filter(|position| position.is_none()).count();
        assert_eq!(n_lost > 0, experiment.note == "positions lost", "{}", experiment.name);
        assert_eq!(read.record.n_rows() < 300, experiment.note == "gap", "{}", experiment.name);
    }
}

/// 40,000 draws give a variance to 0.0071 and a covariance to 0.0056. The limits are five standard errors of six numbers: false failures 3 in a million.
#[test]
fn deviations_have_the_spread_and_the_correlation_that_are_stated() {
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(3);
    let n = 40_000;
    let mut moments = [[0.0; 3]; 3];
    for _ in 0..n {
        let drawn = cohort::deviation(cohort::BETWEEN_LOG_SD, &mut random);
        for (a, row) in moments.iter_mut().enumerate() {
            for (b, moment) in row.iter_mut().enumerate() {
                *moment += drawn[a] * drawn[b] / (cohort::BETWEEN_LOG_SD[a] * cohort::BETWEEN_LOG_SD[b] * f64::from(n));
            }
        }
    }
    for (a, row) in moments.iter().enumerate() {
        for (b, moment) in row.iter().enumerate() {
            let (expected, limit) = if a == b { (1.0, 0.035) } else { (cohort::CORRELATION, 0.028) };
            assert!((moment - expected).abs() < limit, "{moments:?}");
        }
    }
}

#[test]
fn the_readme_states_the_numbers_that_made_the_cohort() {
    let readme = committed("README.md");
    let says = |row: String| assert!(readme.contains(&row), "README.md does not say `{row}`");
    let experiments = cohort::experiments();
    says(format!("{} creep experiments", experiments.len()));
    for species in &cohort::SPECIES {
        let index = experiments.iter().filter(|experiment| experiment.species.name == species.name).count();
        assert!(
            readme
                .lines()
                .any(|l| l.starts_with(&format!("| {} |", species.name)) && l.ends_with(&format!("| {index} |")))
        );
        let median: [f64; 3] =
            std::array::from_fn(|i| vitreo_uq::posterior::replica::TABLE_I[i] * species.ratio_to_porcine[i]);
        says(format!("| {} | {:.3} | {:.3} | {:.3} |", species.name, median[0], median[1], median[2]));
        says(format!("| {} {:.1} mm |", species.name, species.vitreous_diameter_mm));
    }
    for region in &cohort::REGIONS {
        says(format!("| {} × {} |", region.name, region.factor));
    }
    let [e, c1, c2] = cohort::BETWEEN_LOG_SD;
    says(format!("| {e}, {c1}, {c2} |"));
    says(format!("| {} in all three |", cohort::WITHIN_LOG_SD[0]));
    says(format!("| {} between any two |", cohort::CORRELATION));
    says(format!("| {} × {} |", cohort::OUTLIER.0, cohort::OUTLIER.1));
    let noise: Vec<String> = cohort::NOISE_UM.iter().map(f64::to_string).collect();
    says(format!("| {} µm |", noise.join(", ")));
    says(format!("{} a row", cohort::STEPS_PER_SAMPLE));
}
