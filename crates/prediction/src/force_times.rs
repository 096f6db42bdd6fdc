//! Times of a force: its longest hold and its fastest turn.

/// Longest time (s) after the first load in which the force stays within `least_n` (N) of its value at the start of that time.
pub(crate) fn longest_hold_s(time_s: &[f64], force_n: &[f64], least_n: f64) -> f64 {
    let mut hold: Option<(f64, f64)> = None;
    let mut longest_s = 0.0_f64;
    for (&time_s, &force_n) in time_s.iter().zip(force_n) {
        match hold {
            None if force_n.abs() <= least_n => {}
            Some((begin_s, at_n)) if (force_n - at_n).abs() <= least_n => longest_s = longest_s.max(time_s - begin_s),
            _ => {
                // The force before holds until this row.
                longest_s = longest_s.max(hold.map_or(0.0, |(begin_s, _)| time_s - begin_s));
                hold = Some((time_s, force_n));
            }
        }
    }
    longest_s
}

/// Shortest time (s) between two turning points of the force, such as the length of a pulse or half the period of a wave; infinite without two of them. Changes up to `least_n` (N) are noise.
pub(crate) fn fastest_change_s(time_s: &[f64], force_n: &[f64], least_n: f64) -> f64 {
    // Time (s) at which each rise or fall shows, and the force (N) there.
    let mut begins: Vec<(f64, f64)> = Vec::new();
    let (mut direction, mut farthest_n, mut is_wave) = (0.0, 0.0, false);
    for (&time_s, &force_n) in time_s.iter().zip(force_n) {
        let change_n: f64 = force_n - farthest_n;
        let goes_on = direction != 0.0 && change_n * direction > 0.0;
        if change_n.abs() > least_n && !goes_on {
            begins.push((time_s, force_n));
            direction = change_n.signum();
        } else if !goes_on {
            continue;
        }
        farthest_n = force_n;
        // The first rise is no jump.
        is_wave |= begins.len() == 1 && (force_n - begins[0].1).abs() > least_n;
    }
    let mut gaps_s: Vec<f64> = begins.windows(2).map(|pair| pair[1].0 - pair[0].0).collect();
    if let Some(first_s) = gaps_s.first_mut().filter(|_| is_wave) {
        // From 0 to its first maximum a wave takes a quarter of its period.
        *first_s *= 2.0;
    }
    gaps_s.into_iter().fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    const INTERVAL_S: f64 = 0.01;
    const LEAST_N: f64 = 0.2;

    /// Times (s) and forces (N) of 20 s, with noise of at most ±`noise_n`.
    fn rows(force_n: impl Fn(f64) -> f64, noise_n: f64) -> (Vec<f64>, Vec<f64>) {
        let time_s: Vec<f64> = (0..2000).map(|row| INTERVAL_S * f64::from(row)).collect();
        let noise = |row: usize| noise_n * (2.0 * (row as f64 * 0.618_034).fract() - 1.0);
        let force_n = time_s.iter().enumerate().map(|(row, t)| force_n(*t) + noise(row)).collect();
        (time_s, force_n)
    }

    #[test]
    fn holds_are_those_of_the_force_without_its_noise() {
        let switched = |t: f64| if t < 12.0 || (15.0..16.0).contains(&t) { 0.0 } else { 1.0 };
        for noise_n in [0.0, 0.05, 0.09] {
            let (time_s, force_n) = rows(switched, noise_n);
            assert!((longest_hold_s(&time_s, &force_n, LEAST_N) - 4.0).abs() < 2.0 * INTERVAL_S, "{noise_n}");
        }
        // A ramp and a slow wave stay near no force for long. The rest before the first load is no hold.
        let (time_s, force_n) = rows(|t| t / 20.0, 0.0);
        assert!((longest_hold_s(&time_s, &force_n, LEAST_N) - 4.0).abs() < 2.0 * INTERVAL_S);
        let (time_s, force_n) = rows(|t| (0.1 * std::f64::consts::TAU * t).sin(), 0.0);
        assert!(longest_hold_s(&time_s, &force_n, LEAST_N) < 3.0);
        assert_eq!(longest_hold_s(&[], &[], 0.0), 0.0);
    }

    #[test]
    fn the_fastest_turn_is_a_pulse_or_half_a_wave() {
        for noise_n in [0.0, 0.05, 0.09] {
            let (time_s, force_n) = rows(|t| if (3.0..3.5).contains(&t) { 1.0 } else { 0.0 }, noise_n);
            assert!((fastest_change_s(&time_s, &force_n, LEAST_N) - 0.5).abs() < 2.0 * INTERVAL_S, "{noise_n}");
        }
        for frequency_hz in [0.1, 1.0] {
            let (time_s, force_n) = rows(|t| (frequency_hz * std::f64::consts::TAU * t).sin(), 0.0);
            let ratio = 2.0 * frequency_hz * fastest_change_s(&time_s, &force_n, LEAST_N);
            assert!((ratio - 1.0).abs() < 0.05, "{frequency_hz} Hz: {ratio}");
        }
        // One step, and one ramp, turn nowhere.
        for force in [|t: f64| f64::from(t > 3.0), |t: f64| t / 20.0] {
            let (time_s, force_n) = rows(force, 0.0);
            assert_eq!(fastest_change_s(&time_s, &force_n, LEAST_N), f64::INFINITY);
        }
    }
}
