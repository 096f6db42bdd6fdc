use super::*;

struct Rows {
    time_s: Vec<f64>,
    position_um: Vec<Option<f64>>,
    force_un: Vec<f64>,
    median_um: Vec<f64>,
    limits: [Vec<f64>; 4],
}

fn rows(n: usize, interval_s: f64) -> Rows {
    let time_s: Vec<f64> = (0..n).map(|i| i as f64 * interval_s).collect();
    let median_um: Vec<f64> = time_s.iter().map(|t| 100.0 * t.sin()).collect();
    let shifted = |d: f64| median_um.iter().map(|m| m + d).collect::<Vec<f64>>();
    Rows {
        position_um: median_um.iter().enumerate().map(|(i, m)| (i % 7 != 3).then_some(m + 3.0)).collect(),
        force_un: (0..n).map(|i| if (i / 10) % 2 == 0 { 4.6 } else { -4.6 }).collect(),
        limits: [shifted(-2.0), shifted(2.0), shifted(-5.0), shifted(5.0)],
        time_s,
        median_um,
    }
}

fn data<'a>(rows: &'a Rows, cycles: &'a [CycleSpan]) -> PredictiveData<'a> {
    PredictiveData {
        title: "a specimen with a very long name ".repeat(8).leak(),
        time_s: &rows.time_s,
        position_um: &rows.position_um,
        force_un: &rows.force_un,
        median_um: &rows.median_um,
        band_50_um: Band { lower: &rows.limits[0], upper: &rows.limits[1] },
        band_90_um: Band { lower: &rows.limits[2], upper: &rows.limits[3] },
        cycles,
        noise: Some((4.0, "known noise")),
    }
}

#[test]
fn lost_rows_have_no_dot_and_residuals_are_scored() {
    let rows = rows(70, 0.1);
    let cycles = [CycleSpan { cycle: 1, start_s: 0.0, end_s: 7.0, kind: CycleKind::Calibration }];
    let document = predictive(&data(&rows, &cycles)).unwrap().document();
    // There are 60 positions. Each has one dot over the bands and one among the residuals.
    assert_eq!(document.matches("h0").count(), 120);
    assert!(document.contains("fitted RMSE 3.0 µm"), "every residual is 3 µm");
    assert!(document.contains("σ = 4.0 µm") && document.contains("cycle 1: fitted"));
}

#[test]
fn a_long_pause_breaks_the_median() {
    let mut rows = rows(40, 0.1);
    let unbroken = Lines::new(&data(&rows, &[]));
    assert!(unbroken.time_s.iter().all(|t| t.is_finite()));
    rows.time_s[20..].iter_mut().for_each(|t| *t += 5.0);
    assert_eq!(Lines::new(&data(&rows, &[])).time_s.iter().filter(|t| t.is_nan()).count(), 1);
}

#[test]
fn force_is_shown_in_a_unit_with_readable_numbers() {
    let (label, force) = force_in_readable_unit(&[1.2e-6, -0.9e-6]);
    assert_eq!(label, "force (pN)");
    assert!((force[0] - 1.2).abs() < 1e-12);
    assert_eq!(force_in_readable_unit(&[4.6]).0, "force (µN)");
}

#[test]
fn unequal_lengths_are_refused() {
    let mut rows = rows(40, 0.1);
    rows.force_un.pop();
    assert!(predictive(&data(&rows, &[])).unwrap_err().to_string().contains("one value per row"));
    rows = self::rows(40, 0.1);
    rows.time_s[5] = 0.0;
    assert!(predictive(&data(&rows, &[])).unwrap_err().to_string().contains("the times do not increase"));
}

#[test]
fn no_measurement_and_no_prediction_can_be_drawn() {
    let mut rows = rows(40, 0.1);
    rows.position_um.iter_mut().for_each(|p| *p = None);
    rows.median_um.iter_mut().for_each(|m| *m = f64::NAN);
    assert!(predictive(&data(&rows, &[])).unwrap().png().is_ok());
}
