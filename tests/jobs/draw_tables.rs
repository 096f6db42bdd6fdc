//! Two ways of reading a table of draws give the same numbers.

use vitreo_uq::figures::draws::DrawTable;

/// The numbers encode their positions, in a table with different side lengths. Reading by position and by column agree.
#[test]
fn a_place_and_a_column_of_a_table_are_the_same() {
    let (n_ensembles, n_walkers, n_steps, n_parameters) = (2, 3, 5, 2);
    let shape =
        || (0..n_ensembles).flat_map(move |e| (0..n_walkers).flat_map(move |w| (0..n_steps).map(move |s| (e, w, s))));
    let place = |(e, w, s): (usize, usize, usize), p: usize| (1000 * e + 100 * w + 10 * s + p) as f64;
    let table = DrawTable {
        parameter_names: vec!["a".into(), "b".into()],
        units: vec!["Pa".into(), "s".into()],
        n_ensembles,
        n_walkers,
        n_steps,
        values: shape().flat_map(|at| (0..n_parameters).map(move |p| place(at, p))).collect(),
        log_density: Vec::new(),
    };
    table.check().unwrap();
    for p in 0..n_parameters {
        for (at, in_column) in shape().zip(table.column(p)) {
            assert_eq!((table.value(at.0, at.1, at.2, p), in_column), (place(at, p), place(at, p)));
        }
    }
    // Mean over the three walkers of the second ensemble at step 4: 1040, 1140, 1240.
    assert_eq!(table.walker_summary(1, 0).mean[4], 1140.0);
}
