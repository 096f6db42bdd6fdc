use super::super::grading::Grading;
use super::super::numbers::Number;
use super::super::system::PointNumbers;
use super::super::{Lanes, Response};
use super::*;
use base::number::Dual;
use laws::rheology::{BaseLaw, Element, RetardationSpectrum, TimeWindow};
use laws::stages::Stages;

const COMPLIANCE_PER_M: f64 = 549.0;
const N_ROWS: usize = 240;

fn number(value: f64) -> Dual {
    Dual::constant(value)
}

/// Returns times (s) of rows at nearly equal intervals.
fn time_s() -> Vec<f64> {
    (0..N_ROWS).map(|row| 0.1 * row as f64 + if row % 7 == 3 { 0.02 } else { 0.0 }).collect()
}

/// Returns a force (N) that changes at every row by up to `size` of itself, as under a controller.
fn trimmed_n(size: f64) -> Vec<f64> {
    let trim = |row: usize| 1.0 + size * (0.5 + (1.7 * row as f64).sin());
    (0..N_ROWS).map(|row| if (row / 40) % 2 == 0 { 2e-6 * trim(row) } else { 0.0 }).collect()
}

fn smooth_n() -> Vec<f64> {
    (0..N_ROWS).map(|row| 2e-6 * (0.05 * row as f64).sin()).collect()
}

/// Returns the Lethersich law with more Kelvin–Voigt bodies. Each body is given by its fraction of the law's elastic compliance and its
/// retardation time in s.
fn law(bodies: &[(f64, f64)]) -> Stages {
    let mut stages = Stages::of_law(BaseLaw::Lethersich.elements(&[3.5, 1.4, 47.0].map(number)));
    for (share, body_s) in bodies {
        let modulus_pa = 3.5 / share;
        stages.law.push(Element::kelvin_voigt(number(modulus_pa), number(modulus_pa * body_s)));
    }
    stages.load.gradient_per_m = number(-600.0);
    stages
}

fn fractional(order: f64) -> Stages {
    let mut stages = law(&[]);
    let springpot = Element::Springpot { modulus_pa: number(3.5), time_s: number(0.4), order: number(order) };
    stages.law[0] = Element::Parallel(vec![Element::Spring { modulus_pa: number(3.5) }, springpot]);
    stages
}

fn spectrum(stages: &Stages) -> RetardationSpectrum<f64> {
    let window = TimeWindow { shortest_s: 1e-3, longest_s: 24.0 };
    RetardationSpectrum::of_law(&stages.law, window)
        .map(|spectrum| RetardationSpectrum {
            instantaneous_per_pa: spectrum.instantaneous_per_pa.value,
            modes: spectrum.modes.iter().map(value_of_mode).collect(),
            oscillating: Vec::new(),
            fluidity_per_pa_s: spectrum.fluidity_per_pa_s.value,
        })
        .expect("a spectrum")
}

fn value_of_mode(mode: &laws::rheology::SpectralMode) -> laws::rheology::SpectralMode<f64> {
    laws::rheology::SpectralMode { compliance_per_pa: mode.compliance_per_pa.value, rate_per_s: mode.rate_per_s.value }
}

/// Returns the positions (m) at the rows. `None` uses the law's own grading.
fn positions_m(time_s: &[f64], force_n: &[f64], stages: &Stages, grading: Option<Grading>) -> Vec<f64> {
    let mut point = PointNumbers::with_spectrum(stages, &spectrum(stages), COMPLIANCE_PER_M, 2e-6);
    point.grading = grading.unwrap_or(point.grading);
    let mut position_m = Vec::new();
    assert!(Response::new(time_s, force_n, time_s.len()).run::<f64>(&[&point], &mut position_m)[0]);
    position_m
}

/// Returns positions (m) from much finer steps: eight for each row, with the shortest steps after every switch.
fn finest_m(time_s: &[f64], force_n: &[f64], stages: &Stages) -> Vec<f64> {
    const N_PARTS: usize = 8;
    let last = time_s.len() - 1;
    let fine = |row: usize, part: usize| time_s[row] + (time_s[row + 1] - time_s[row]) * part as f64 / N_PARTS as f64;
    let mut fine_s: Vec<f64> =
        (0..last).flat_map(|row| (0..N_PARTS).map(move |part| (row, part))).map(|(r, p)| fine(r, p)).collect();
    fine_s.push(time_s[last]);
    let fine_n: Vec<f64> = (0..fine_s.len()).map(|row| force_n[row / N_PARTS]).collect();
    let finest = Grading { exponents: [-12; N_SIZES] };
    positions_m(&fine_s, &fine_n, stages, Some(finest)).into_iter().step_by(N_PARTS).collect()
}

/// Largest difference of two trajectories, divided by the largest position.
fn distance(found_m: &[f64], expected_m: &[f64]) -> f64 {
    let amplitude = expected_m.iter().fold(0.0_f64, |a, x| a.max(x.abs()));
    found_m.iter().zip(expected_m).fold(0.0_f64, |d, (a, b)| d.max((a - b).abs())) / amplitude
}

fn forces_n() -> Vec<(String, Vec<f64>)> {
    let trimmed = [0.0, 0.004, 0.06, 0.9].map(|size| (format!("trimmed by {size}"), trimmed_n(size)));
    trimmed.into_iter().chain([("smooth".to_string(), smooth_n())]).collect()
}

/// Compares graded steps with much finer steps. The laws have fast bodies of small and large compliance; the force changes by
/// small and large amounts, at rows and between them.
#[test]
fn graded_steps_of_bodies_are_far_finer_ones_within_1e_8() {
    let time_s = time_s();
    let mut largest = 0.0_f64;
    let mut strongest = 0.0_f64;
    for bodies in [&[][..], &[(0.3, 1e-1)], &[(0.3, 4e-3)], &[(0.3, 3e-5)], &[(0.5, 2e-2), (0.02, 1e-4)]] {
        for (name, force_n) in forces_n() {
            for delay_s in [0.0, 1e-4, 0.037, 0.0999, 0.23] {
                let mut stages = law(bodies);
                stages.load.delay_s = number(delay_s);
                let exact_m = finest_m(&time_s, &force_n, &stages);
                let graded_m = positions_m(&time_s, &force_n, &stages, None);
                let error = distance(&graded_m, &exact_m);
                largest = largest.max(error);
                strongest = exact_m.iter().fold(strongest, |s, x| s.max(600.0 * x.abs()));
                assert!(error < 1e-8, "{bodies:?}, {name}, delay {delay_s}: {error:e}");
            }
        }
    }
    println!("graded against far finer: {largest:.1e}, strongest feedback {strongest:.2}");
}

/// Compares graded steps with much finer steps behind a lag, in a softening gel and with a springpot.
#[test]
fn graded_steps_with_all_else_are_far_finer_ones_within_1e_8() {
    let time_s = time_s();
    for (law_name, of_law) in [
        ("bodies", law(&[(0.3, 4e-3), (0.1, 2e-4)])),
        ("springpot", fractional(0.5)),
        ("flat springpot", fractional(0.2)),
    ] {
        for lag_time_s in [0.0, 1e-3, 0.02, 0.3] {
            for (name, force_n) in forces_n() {
                let mut stages = of_law.clone();
                stages.load.lag_time_s = number(lag_time_s);
                stages.load.gradient_per_m = number(-400.0);
                stages.softening_rate_per_s = number(0.01);
                stages.load.delay_s = number(0.03);
                let found_m = positions_m(&time_s, &force_n, &stages, None);
                let error = distance(&found_m, &finest_m(&time_s, &force_n, &stages));
                println!("{law_name}, lag {lag_time_s}, {name}: {error:.1e}");
                assert!(error < 1e-8, "{law_name}, lag {lag_time_s}, {name}: {error:e}");
            }
        }
    }
}

/// Checks that a small switch allows longer steps than a large one, and that a law without fast modes allows steps of any length.
/// A faster or larger mode never allows longer steps.
#[test]
fn first_steps_follow_sizes_shares_and_rates() {
    let grading = |share: f64, rate: f64| Grading::new(&[(share, rate)], &[(share * rate, rate), (0.5, 0.7)], 0.3);
    let mut before = [i32::MAX; N_SIZES];
    for rate in [0.01, 1.0, 30.0, 1e3, 1e4] {
        let found = grading(0.3, rate).exponents;
        assert!(found.is_sorted(), "{rate}: {found:?}");
        assert!(found.iter().zip(before).all(|(now, before)| *now <= before), "{rate}: {found:?}");
        assert!(grading(0.003, rate).exponents.iter().zip(found).all(|(less, more)| *less >= more), "{rate}");
        before = found;
    }
    let of_small_share = grading(0.003, 1e4).exponents;
    assert!(of_small_share[0] < of_small_share[1], "{of_small_share:?}");
    assert_eq!([2.0, 1.0, 0.2, 0.125, 0.02, 1.0 / 64.0, 1e-6].map(class), [0, 0, 0, 1, 1, 2, 2]);
}

/// Checks that the pieces fill the intervals between rows and end at rows. There is one step for each row without fast modes, and
/// only a few more if changes are small.
#[test]
fn parts_fill_the_rows() {
    let time_s = time_s();
    let parts = |force_n: &[f64], delay_s: f64, longest_s: [f64; N_SIZES]| {
        let record = PreparedRows::new(&time_s, force_n.into(), N_ROWS);
        let parts = Parts::new(&record, (delay_s > 0.0).then_some(delay_s), longest_s, SHARE_OF_AGE);
        let (mut now_s, mut n_steps, mut row) = (0.0, 0, 1);
        for piece in &parts.pieces {
            n_steps += piece.n_steps();
            now_s += parts.length_s[piece.length] * piece.n_steps() as f64;
            if !piece.rows.is_empty() {
                assert_eq!(piece.rows.start, row);
                row = piece.rows.end;
                assert!((now_s - time_s[row - 1]).abs() < 1e-11, "row {row}: {now_s}");
            }
        }
        assert_eq!(row, N_ROWS);
        n_steps
    };
    for delay_s in [0.0, 1e-9, 0.05, 0.31] {
        for longest_s in [[f64::INFINITY; 3], [1e-3, 1e-2, 1.0], [1e-7; 3]] {
            parts(&trimmed_n(0.06), delay_s, longest_s);
        }
    }
    assert_eq!(parts(&trimmed_n(0.06), 0.0, [f64::INFINITY; 3]), N_ROWS - 1);
    let [small, large] = [0.004, 0.06].map(|size| parts(&trimmed_n(size), 0.0, [1e-4, 1e-2, 1.0]));
    assert!(small < 3 * N_ROWS && large > 2 * small, "{small} and {large} steps");
}

/// Checks that points with different delays wait for each other, and that the waiting changes no bit of their positions.
#[test]
fn points_with_their_own_delays_share_a_schedule() {
    let (time_s, force_n) = (time_s(), trimmed_n(0.06));
    let points: Vec<Stages> = [0.0001, 0.03, 0.0999, 0.1, 0.12, 0.25, 1.7, 50.0]
        .map(|delay_s| {
            let mut stages = law(&[(0.3, 4e-3)]);
            (stages.load.delay_s, stages.load.lag_time_s) = (number(delay_s), number(0.01));
            stages
        })
        .to_vec();
    assert_bits_of_single_points(&time_s, &force_n, &points);
}

/// Checks that points whose laws need different step lengths share one schedule without a change of their positions.
#[test]
fn points_with_their_own_gradings_share_a_schedule() {
    let points = [0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.7, 0.9].map(fractional).to_vec();
    let gradings = points
        .iter()
        .map(|stages| PointNumbers::with_spectrum(stages, &spectrum(stages), COMPLIANCE_PER_M, 2e-6).grading.exponents);
    let mut distinct: Vec<_> = gradings.collect();
    distinct.dedup();
    assert!(distinct.len() > 2, "{distinct:?}");
    assert_bits_of_single_points(&time_s(), &trimmed_n(0.06), &points);
}

fn assert_bits_of_single_points(time_s: &[f64], force_n: &[f64], points: &[Stages]) {
    let response = Response::new(time_s, force_n, N_ROWS);
    let mut positions_m: Vec<Lanes> = Vec::new();
    assert_eq!(response.trajectories_m(points, &[COMPLIANCE_PER_M; N_LANES], &mut positions_m), [true; N_LANES]);
    for (lane, stages) in points.iter().enumerate() {
        let alone_m = response.trajectory_m(stages, COMPLIANCE_PER_M).expect("sound");
        for (row, alone_m) in alone_m.iter().enumerate() {
            assert_eq!(positions_m[row].lane(lane).to_bits(), alone_m.to_bits(), "lane {lane}, row {row}");
        }
    }
}
