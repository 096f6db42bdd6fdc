use record::Record;
use record::protocol_change::{Change, changes};

use crate::separation::tests::{ONE_LEVEL, TWO_LEVELS, record};

fn find<'a>(list: &'a [Change], words: &str) -> &'a Change {
    list.iter().find(|change| change.instruction.contains(words)).expect("a change of these words")
}

/// Returns the forces (µN) in the middle of every interval of `length_s` (s).
fn forces_un(record: &Record, length_s: f64) -> Vec<f64> {
    let n = (record.time_s.last().expect("rows") / length_s).ceil() as usize;
    let at = |i: usize| record.time_s.partition_point(|t| *t <= (i as f64 + 0.5) * length_s) - 1;
    (0..n).map(|i| (1e8 * record.force_n[at(i)]).round() / 100.0).collect()
}

#[test]
fn every_change_keeps_duration_cycles_and_the_largest_force() {
    for cycles in [&ONE_LEVEL[..], &TWO_LEVELS[..], &[&[3.0, 0.0][..]; 3][..], &[&[3.0, 0.0][..]][..]] {
        let entry = record(cycles);
        let largest = entry.force_n.iter().fold(0.0_f64, |a, b| a.max(b.abs()));
        let list = changes(&entry, 5.0);
        assert!(list.len() >= 4, "{list:?}");
        for change in list {
            let made = &change.record;
            let n = made.n_rows();
            assert!([made.force_n.len(), made.position_m.len(), made.cycle.len()].iter().all(|length| *length == n));
            assert!(made.time_s.windows(2).all(|pair| pair[0] < pair[1]), "{}", change.instruction);
            assert_eq!(made.n_cycles(), entry.n_cycles(), "{}", change.instruction);
            assert!((made.time_s[n - 1] - entry.time_s[entry.n_rows() - 1]).abs() < 0.1, "{}", change.instruction);
            let force_n = made.force_n.iter().fold(0.0_f64, |a, b| a.max(b.abs()));
            assert!((force_n / largest - 1.0).abs() < 1e-12, "{}", change.instruction);
            assert!(made.force_n != entry.force_n || made.time_s.len() != entry.n_rows(), "{}", change.instruction);
        }
    }
}

#[test]
fn changes_do_what_they_say() {
    let list = changes(&record(&ONE_LEVEL), 5.0);
    let un = |words: &str, length_s: f64| forces_un(&find(&list, words).record, length_s);
    assert_eq!(un("half the force (2.3 µN) in every second cycle", 5.0), [4.6, -4.6, 2.3, -2.3, 4.6, -4.6, 2.3, -2.3]);
    assert_eq!(un("(4.6 µN, 2.3 µN, 3.45 µN) in turn", 5.0), [4.6, -4.6, 2.3, -2.3, 3.45, -3.45, 4.6, -4.6]);
    assert_eq!(un("then again with half the force", 2.5)[..4], [4.6, -4.6, 2.3, -2.3]);
    assert_eq!(un("in one direction only", 5.0)[..4], [4.6, 0.0, 4.6, 0.0]);
    assert_eq!(un("Hold half as long (2.5 s)", 2.5)[..4], [4.6, -4.6, 4.6, -4.6]);
    assert_eq!(un("a quarter as long (1.25 s)", 1.25)[..10], [4.6, 4.6, 4.6, 4.6, -4.6, -4.6, -4.6, -4.6, 4.6, -4.6]);
    assert_eq!(un("twice as long (10 s)", 10.0), [4.6, -4.6, 4.6, -4.6]);
    assert_eq!(un("Rest without force", 10.0 / 3.0)[..6], [4.6, -4.6, 0.0, 4.6, -4.6, 0.0]);
    assert_eq!(find(&list, "Sample 4 times as fast, every 0.025 s").record.n_rows(), 1600);
    let one_way = changes(&record(&[&[3.0, 0.0][..]; 3]), 5.0);
    assert_eq!(forces_un(&find(&one_way, "Reverse").record, 5.0), [3.0, 0.0, -3.0, 0.0, 3.0, 0.0]);
}
