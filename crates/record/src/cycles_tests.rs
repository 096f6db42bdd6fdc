use super::*;

/// Returns a record of holds, each given by its duration (s) and force. The record is sampled every `interval_s`, without the end point.
fn record(holds: &[(f64, f64)], interval_s: f64) -> Record {
    let mut record = Record::default();
    let mut start_s = 0.0;
    for &(duration_s, force_n) in holds {
        let n = (duration_s / interval_s).round() as usize;
        record.time_s.extend((0..n).map(|i| start_s + i as f64 * interval_s));
        record.force_n.extend(std::iter::repeat_n(force_n, n));
        start_s += duration_s;
    }
    record.position_m = vec![Some(0.0); record.time_s.len()];
    record.cycle = vec![1; record.time_s.len()];
    record
}

/// Returns the start times (s) of the cycles that [`find_cycles`] finds.
fn starts_s(record: &Record) -> Vec<f64> {
    let cycle = find_cycles(record).cycle;
    assert_eq!(cycle[0], 1);
    let first_rows = (0..cycle.len()).filter(|&row| row == 0 || cycle[row] != cycle[row - 1]);
    first_rows.map(|row| record.time_s[row]).collect()
}

fn assert_starts(record: &Record, expected_s: &[f64]) {
    let found = starts_s(record);
    let same = found.len() == expected_s.len() && found.iter().zip(expected_s).all(|(a, b)| (a - b).abs() < 1e-9);
    assert!(same, "found {found:?}, expected {expected_s:?}: {}", find_cycles(record).text);
}

#[test]
fn push_and_pull_of_equal_length() {
    assert_starts(&record(&[(5.0, 4.6), (5.0, -4.6)].repeat(4), 0.05), &[0.0, 10.0, 20.0, 30.0]);
}

#[test]
fn pull_release_push_release_is_one_cycle_of_four_holds() {
    assert_starts(&record(&[(2.0, 1.0), (3.0, 0.0), (2.0, -1.0), (3.0, 0.0)].repeat(3), 0.1), &[0.0, 10.0, 20.0]);
}

#[test]
fn weak_and_strong_pulls_in_turn_make_one_cycle() {
    assert_starts(&record(&[(2.0, 1.0), (2.0, 0.0), (2.0, 2.0), (2.0, 0.0)].repeat(3), 0.1), &[0.0, 8.0, 16.0]);
}

#[test]
fn a_staircase_up_and_down_repeats_but_a_staircase_up_does_not() {
    let stairs = [(2.0, 1.0), (2.0, 2.0), (2.0, 3.0), (2.0, 2.0)];
    assert_starts(&record(&stairs.repeat(3), 0.1), &[0.0, 8.0, 16.0]);
    assert_starts(&record(&[(2.0, 1.0), (2.0, 2.0), (2.0, 3.0), (2.0, 4.0)], 0.1), &[0.0]);
}

#[test]
fn a_rest_before_and_after_stays_in_the_first_and_last_cycle() {
    let mut holds = vec![(17.0, 0.0)];
    holds.extend([(5.0, 3.0), (5.0, -3.0)].repeat(3));
    holds.push((30.0, 0.0));
    assert_starts(&record(&holds, 0.1), &[0.0, 27.0, 37.0]);
}

#[test]
fn rests_that_open_each_cycle_are_part_of_it() {
    assert_starts(&record(&[(5.0, 0.0), (5.0, 3.0)].repeat(3), 0.1), &[0.0, 10.0, 20.0]);
}

#[test]
fn an_incomplete_last_cycle_is_counted_and_named() {
    let mut holds = [(5.0, 3.0), (5.0, -3.0)].repeat(2);
    holds.push((2.0, 3.0));
    let record = record(&holds, 0.1);
    assert_starts(&record, &[0.0, 10.0, 20.0]);
    assert!(find_cycles(&record).text.contains("incomplete"));
}

#[test]
fn an_end_point_that_already_carries_the_next_force_starts_no_cycle() {
    let mut record = record(&[(5.0, 3.0), (5.0, -3.0)].repeat(2), 0.1);
    record.time_s.push(20.0);
    record.force_n.push(3.0);
    assert_starts(&record, &[0.0, 10.0]);
}

#[test]
fn drifting_ramped_irregular_and_gappy_forces_are_still_understood() {
    let mut record = record(&[(5.0, 4.6), (5.0, -4.6)].repeat(5), 0.05);
    // The force drifts by 15 % over the record and ripples below the step threshold. Each change of level is spread over two rows.
    let exact = record.force_n.clone();
    for (row, force) in record.force_n.iter_mut().enumerate() {
        let before = exact[row.saturating_sub(1)];
        *force = if before == exact[row] { exact[row] } else { 0.1 * exact[row] };
        *force *= 1.0 + 0.15 * row as f64 / 1000.0 + 0.03 * ((row * 7919) % 13) as f64 / 13.0;
    }
    // Times have random errors, and a gap of two seconds interrupts a hold.
    for (row, time_s) in record.time_s.iter_mut().enumerate() {
        *time_s += 0.02 * ((row * 104_729) % 17) as f64 / 17.0;
    }
    let keep: Vec<bool> = record.time_s.iter().map(|time_s| !(22.0..24.0).contains(time_s)).collect();
    let kept =
        |values: &[f64]| -> Vec<f64> { values.iter().zip(&keep).filter(|(_, keep)| **keep).map(|(v, _)| *v).collect() };
    record.time_s = kept(&record.time_s);
    record.force_n = kept(&record.force_n);
    let starts = starts_s(&record);
    assert_eq!(starts.len(), 5, "{starts:?}");
    assert!(
        starts.iter().zip([0.0, 10.0, 20.0, 30.0, 40.0]).all(|(found, true_s)| (found - true_s).abs() < 0.1),
        "{starts:?}"
    );
}

#[test]
fn levels_that_differ_widely_repeat_in_direction_and_say_so() {
    let pulls = [1.6, 1.4, 2.6, 3.0, 2.7, 3.0];
    let holds: Vec<(f64, f64)> = pulls.iter().flat_map(|pull| [(100.0, *pull), (100.0, 0.0)]).collect();
    let record = record(&holds, 5.0);
    assert_starts(&record, &[0.0, 200.0, 400.0, 600.0, 800.0, 1000.0]);
    assert!(find_cycles(&record).text.contains("levels differ"));
}

#[test]
fn what_does_not_repeat_is_one_cycle() {
    for holds in [&[(10.0, 2.0)][..], &[(5.0, 2.0), (20.0, 0.0)], &[(3.0, 1.0), (9.0, -2.0), (1.0, 1.5), (40.0, -1.0)]]
    {
        let record = record(holds, 0.1);
        assert_starts(&record, &[0.0]);
        assert!(find_cycles(&record).text.contains("one cycle"));
    }
}

#[test]
fn a_sine_repeats_without_steps() {
    let mut record = record(&[(40.0, 0.0)], 0.05);
    for (force, time_s) in record.force_n.iter_mut().zip(&record.time_s) {
        *force = (std::f64::consts::TAU * time_s / 8.0).sin();
    }
    let starts = starts_s(&record);
    assert_eq!(starts.len(), 5, "{starts:?}");
    assert!(starts.iter().enumerate().all(|(i, start_s)| (start_s - 8.0 * i as f64).abs() <= 0.1), "{starts:?}");
    // A slow monotonic ramp does not repeat.
    let n_rows = record.n_rows() as f64;
    record.force_n.iter_mut().enumerate().for_each(|(row, force)| *force = row as f64 / n_rows);
    assert_starts(&record, &[0.0]);
}

#[test]
fn steps_at_the_very_threshold_do_not_hide_the_repetition() {
    // The change from 0 to 1 is a fifth of the range from −2 to 3. In each cycle, a ripple of 2 % decides whether it counts as a step.
    let mut record = record(&[(5.5, 1.0), (3.0, 0.0), (6.8, 2.0), (6.7, -2.0), (9.4, 3.0), (3.3, 0.0)].repeat(4), 0.1);
    record
        .force_n
        .iter_mut()
        .enumerate()
        .for_each(|(row, force)| *force *= 0.98 + 0.04 * ((row * 7919) % 13) as f64 / 13.0);
    let starts = starts_s(&record);
    assert_eq!(starts.len(), 4, "{starts:?}");
    assert!(starts.iter().enumerate().all(|(i, start_s)| (start_s - 34.7 * i as f64).abs() < 0.35), "{starts:?}");
}

/// Returns a record of `n_cycles` repetitions of `pattern`, whose holds are given by duration (s) and level. The force ripples, and drifts from cycle
/// to cycle. Sample times are irregular, and one sample in ten is lost. The last cycle lacks the fraction `cut` of its rows.
fn random_record(rng: &mut rand_chacha::ChaCha8Rng, pattern: &[(f64, f64)], n_cycles: u32, cut: f64) -> Record {
    use rand::RngExt;
    let drift = rng.random_range(-0.012..0.012);
    let mut record = Record::default();
    let mut start_s = 0.0;
    for cycle in 0..n_cycles {
        for &(duration_s, level) in pattern {
            let mut t_s = 0.0;
            while t_s < duration_s {
                let ripple = rng.random_range(-0.02..0.02);
                if record.time_s.is_empty() || rng.random_bool(0.9) {
                    record.time_s.push(start_s + t_s);
                    record.force_n.push(level * (1.0 + drift * f64::from(cycle) + ripple));
                    record.cycle.push(cycle + 1);
                }
                t_s += rng.random_range(0.05..0.15);
            }
            start_s += duration_s;
        }
    }
    let in_last = record.cycle.iter().filter(|cycle| **cycle == n_cycles).count();
    let n_kept = record.cycle.len() - (cut * in_last as f64) as usize;
    record.time_s.truncate(n_kept);
    record.force_n.truncate(n_kept);
    record.cycle.truncate(n_kept);
    record.position_m = vec![None; n_kept];
    record
}

/// Tests 2,000 random protocols of two to eight cycles. Each protocol has one or two levels, and returns to zero or reverses the force after each
/// level. Some records are cut short. All changes of force exceed 20 % of the range. The true cycles are therefore unique, and the cycle of every row
/// must be right.
#[test]
fn random_protocols_are_found_row_for_row() {
    use rand::{RngExt, SeedableRng};
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
    let mut wrong = Vec::new();
    for _ in 0..2000 {
        let mut pattern: Vec<(f64, f64)> = Vec::new();
        for level in [2.6, 5.0].into_iter().take(rng.random_range(1..=2)) {
            pattern.push((rng.random_range(2.0..10.0), level));
            pattern.push((rng.random_range(2.0..10.0), if rng.random_bool(0.5) { 0.0 } else { -level }));
        }
        let n_cycles = rng.random_range(2..=8);
        let cut = if n_cycles > 2 && rng.random_bool(0.5) { rng.random_range(0.0..0.7) } else { 0.0 };
        let record = random_record(&mut rng, &pattern, n_cycles, cut);
        let found = find_cycles(&record);
        if found.cycle != record.cycle {
            wrong.push(format!("{pattern:?}, {n_cycles} cycles, cut {cut}: {}", found.text));
        }
    }
    assert!(wrong.is_empty(), "{} of 2000 wrong: {:#?}", wrong.len(), &wrong[..wrong.len().min(5)]);
}

#[test]
fn absurd_times_end_the_search() {
    for (start_s, spacing_s) in [(1e15, 0.125), (0.0, 5e-324), (0.0, 1e305)] {
        let mut record = record(&[(4.0, 0.0)], 0.1);
        for (row, (time_s, force)) in record.time_s.iter_mut().zip(&mut record.force_n).enumerate() {
            *time_s = start_s + row as f64 * spacing_s;
            *force = f64::from([0, 3, 5, 3][row % 4] as u8);
        }
        assert_eq!(find_cycles(&record).cycle.len(), record.n_rows());
    }
}
