//! Trajectories at more times than the record's rows. A delayed or lagging force then needs no further runs.
//!
//! If the law does not change with time, a force delayed by δ gives exactly the delayed trajectory x(t − δ). For a force with a lag τ, the
//! lag is applied to the trajectory x: τ ż = x − z. The lagged trajectory z is exact for linear laws and correct to first order in τ for
//! all others.

use base::number::PointScalar;
use laws::stages::Load;
use record::{Force, ForceRule};

/// Smallest number of times in every hold of the force.
const POINTS_PER_HOLD: f64 = 256.0;
/// Largest number of times between two rows.
const MOST_BETWEEN_ROWS: f64 = 16.0;
/// Largest total number of times.
const MOST_POINTS: usize = 20_000;
/// Number of neighbouring times through which a cubic polynomial interpolates a trajectory.
const STENCIL: usize = 4;

/// Times at which a trajectory is computed. They include the times of the rows.
#[derive(Debug, Clone, PartialEq)]
pub struct Clock {
    /// Times in s. They include the times of the rows.
    pub time_s: Vec<f64>,
    /// Index of each row's time in `time_s`.
    pub rows: Vec<usize>,
    /// Indices of the times at which the force or its slope changes. Trajectories are smooth between them.
    breaks: Vec<usize>,
}

impl Clock {
    /// Returns a clock with the times (s) of the rows only.
    pub fn of_rows(time_s: &[f64]) -> Self {
        Self { time_s: time_s.to_vec(), rows: (0..time_s.len()).collect(), breaks: Vec::new() }
    }

    /// Returns a clock that is fine enough for delays and lags. Additional times are evenly spaced between the rows.
    pub fn finer(time_s: &[f64], force: Force<'_>) -> Self {
        let changes: Vec<usize> = (1..force.at_rows_n.len().min(time_s.len()))
            .filter(|row| force.at_rows_n[*row] != force.at_rows_n[row - 1])
            .collect();
        let duration_s = time_s.last().unwrap_or(&0.0) - time_s.first().unwrap_or(&0.0);
        let hold_s = duration_s / (1.0 + changes.len() as f64);
        let most = (MOST_POINTS as f64 / time_s.len().max(1) as f64).clamp(1.0, MOST_BETWEEN_ROWS);
        let (mut finer, mut rows) = (Vec::new(), Vec::with_capacity(time_s.len()));
        for (row, at_s) in time_s.iter().enumerate() {
            rows.push(finer.len());
            finer.push(*at_s);
            let Some(next_s) = time_s.get(row + 1) else { break };
            let n = ((next_s - at_s) * POINTS_PER_HOLD / hold_s).ceil().clamp(1.0, most.floor()) as usize;
            finer.extend((1..n).map(|k| at_s + (next_s - at_s) * k as f64 / n as f64));
        }
        let breaks = if force.is_linear() { Vec::new() } else { changes.iter().map(|row| rows[*row]).collect() };
        Self { time_s: finer, rows, breaks }
    }

    /// Returns the commanded force (N) at the clock's times, for a record's times (s) and force.
    pub fn commanded_n(&self, time_s: &[f64], force: Force<'_>) -> Vec<f64> {
        self.time_s.iter().map(|at_s| force.at_n(time_s, *at_s)).collect()
    }

    /// Number of the clock's times up to the last one of the first `n_rows` rows.
    pub(super) fn n_points(&self, n_rows: usize) -> usize {
        n_rows.checked_sub(1).and_then(|last| self.rows.get(last)).map_or(0, |last| last + 1)
    }

    /// Applies the load's lag and, if requested, its delay to the first values of a trajectory at the clock's times. The lag is applied
    /// first. A delay moves the trajectory's corners between the clock's times, where the straight lines used for the lag would cut them.
    pub(super) fn delayed_and_lagged<N: PointScalar>(&self, mut x: Vec<N>, load: &Load, is_delayed: bool) -> Vec<N> {
        if load.has_lag() {
            x = self.lagging(&x, &load.of());
        }
        if is_delayed && load.is_delayed() {
            x = self.delayed(&x, &load.of());
        }
        x
    }

    /// Returns the delayed trajectory x(t − δ) at the first times of the clock, with δ the load's delay. Before the first time, the
    /// position is that at rest.
    fn delayed<N: PointScalar>(&self, x: &[N], load: &Load<N>) -> Vec<N> {
        let time_s = &self.time_s[..x.len()];
        let at = |own_s: &f64| {
            let t = load.command_time_s(*own_s);
            // At a break the cubic polynomial on the left side is used, because a delay that grows from 0 moves to this side.
            let Some(before) = time_s.partition_point(|point| *point < t.value()).checked_sub(1) else { return x[0] };
            let begin = self.breaks.iter().rev().find(|place| **place <= before).copied().unwrap_or(0);
            let end = self.breaks.iter().find(|place| **place > before).copied().unwrap_or(x.len()).min(x.len() - 1);
            let first =
                (before + 1).saturating_sub(STENCIL / 2).clamp(begin, end.saturating_sub(STENCIL - 1).max(begin));
            let nodes = first..(first + STENCIL).min(end + 1);
            let weight = |node: usize| {
                let others = nodes.clone().filter(|other| *other != node);
                others.fold(N::constant(1.0), |product, other| {
                    product * (t + N::constant(-time_s[other])) * (1.0 / (time_s[node] - time_s[other]))
                })
            };
            nodes.clone().fold(N::constant(0.0), |sum, node| sum + weight(node) * x[node])
        };
        time_s.iter().map(at).collect()
    }

    /// Returns the trajectory x after the load's lag at the first times of the clock. Between the times, x is a straight line.
    fn lagging<N: PointScalar>(&self, x: &[N], load: &Load<N>) -> Vec<N> {
        let mut z = Vec::with_capacity(x.len());
        for (k, item) in x.iter().enumerate() {
            let Some(before) = k.checked_sub(1) else {
                z.push(*item);
                continue;
            };
            let step_s = self.time_s[k] - self.time_s[before];
            z.push(load.lagged_along(z[before], x[before], *item, step_s));
        }
        z
    }

    /// Returns the acting force of a load for an external program, as times (s), forces (N) and the indices of the rows. Delayed
    /// jumps become additional times. A lagging force is replaced by its mean between two times.
    pub fn acting(&self, time_s: &[f64], force: Force<'_>, load: &Load) -> (Vec<f64>, Vec<f64>, Vec<usize>) {
        let load = load.of::<f64>();
        let end_s = self.time_s.last().copied().unwrap_or(0.0);
        let jumps =
            std::iter::once(0).chain(self.breaks.iter().copied()).map(|place| load.action_time_s(self.time_s[place]));
        let mut times: Vec<f64> = self.time_s.iter().copied().chain(jumps.filter(|at_s| *at_s < end_s)).collect();
        times.sort_by(f64::total_cmp);
        times.dedup();
        let rows = self.rows.iter().map(|row| times.partition_point(|at_s| *at_s < self.time_s[*row])).collect();
        let entering = |at_s: f64| {
            let own_n = force.at_n(time_s, load.command_time_s(at_s));
            load.entering_n(own_n, own_n > 0.0)
        };
        let holds = force.rule == ForceRule::Hold;
        let (mut acting_n, mut lagged_n) = (Vec::with_capacity(times.len()), 0.0);
        for (k, at_s) in times.iter().enumerate() {
            let step_s = times.get(k + 1).map_or(0.0, |next| next - at_s);
            // A constant force is evaluated at the middle of the interval, so that rounding does not decide on which side of a
            // jump it is.
            let entering_n = entering(if holds { at_s + 0.5 * step_s } else { *at_s });
            if !load.has_lag() {
                acting_n.push(entering_n);
                continue;
            }
            let begin_n = lagged_n;
            let mean_n;
            [lagged_n, mean_n] = load.lagged_of_hold(begin_n, entering_n, step_s);
            acting_n.push(if holds { mean_n } else { begin_n });
        }
        (times, acting_n, rows)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Response;
    use base::number::Dual;
    use laws::rheology::BaseLaw;
    use laws::stages::Stages;

    /// Compares the delayed and lagged trajectory of a linear law with the closed form for the delayed and lagging force. Delays end at the
    /// clock's times or between them. The error is 1.2e-4, a quarter of the error with twice the step. Derivatives are compared with
    /// difference quotients.
    #[test]
    fn a_later_force_moves_later() {
        let time_s: Vec<f64> = (0..=160).map(|row| 0.25 * f64::from(row)).collect();
        let force_n: Vec<f64> = (0..=160).map(|row| if row / 20 % 2 == 0 { 4.6e-6 } else { -4.6e-6 }).collect();
        let force = Force::from(&force_n);
        let clock = Clock::finer(&time_s, force);
        let mut stages = Stages::of_law(BaseLaw::Lethersich.elements(&[3.5, 1.4, 47.0].map(Dual::constant)));
        let fine_n = clock.commanded_n(&time_s, force);
        let x = Response::new(&clock.time_s, &fine_n, fine_n.len()).trajectory_m(&stages, 549.0).expect("a trajectory");
        let most = x.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        let load = |delay_s: Dual, lag_time_s: Dual| Load { delay_s, lag_time_s, ..Load::COMMANDED };
        let found = |delay_s: f64, lag_s: f64| -> Vec<f64> {
            let later = clock.delayed_and_lagged(x.clone(), &load(delay_s.into(), lag_s.into()), true);
            clock.rows.iter().map(|row| later[*row]).collect()
        };
        for (delay_s, lag_s) in
            [(0.0, 0.0), (0.031, 0.0), (0.62, 0.0), (0.0, 0.02), (0.0, 0.5), (0.2, 0.1), (0.19, 0.1)]
        {
            (stages.load.delay_s, stages.load.lag_time_s) = (delay_s.into(), lag_s.into());
            let exact = Response::new(&time_s, force, time_s.len()).trajectory_m(&stages, 549.0).expect("a trajectory");
            let worst = exact.iter().zip(found(delay_s, lag_s)).fold(0.0_f64, |w, (a, b)| w.max((a - b).abs()));
            assert!(worst < 2e-4 * most, "{delay_s} {lag_s}: {:e}", worst / most);
        }
        let constants: Vec<Dual> = x.iter().map(|x| Dual::constant(*x)).collect();
        // The delay avoids the ends of the cubic polynomials, where their slopes differ.
        let (delay_s, lag_s, step_s) = (0.19, 0.1, 1e-5);
        let lagging =
            |delay_s: Dual, lag_s: Dual| clock.delayed_and_lagged(constants.clone(), &load(delay_s, lag_s), true);
        let slopes = [
            (
                lagging(Dual::variable(delay_s), lag_s.into()),
                found(delay_s + step_s, lag_s),
                found(delay_s - step_s, lag_s),
            ),
            (
                lagging(delay_s.into(), Dual::variable(lag_s)),
                found(delay_s, lag_s + step_s),
                found(delay_s, lag_s - step_s),
            ),
        ];
        for (exact, above, below) in slopes {
            for (row, place) in clock.rows.iter().enumerate() {
                let difference = (above[row] - below[row]) / (2.0 * step_s);
                let slope = exact[*place].derivative;
                assert!((slope - difference).abs() < 1e-4 * most, "{row}: {slope:e} {difference:e}");
            }
        }
    }

    /// Checks the acting force that an external program receives. The closed form for this force must equal the closed form for
    /// the load.
    #[test]
    fn the_acting_force_is_the_loads() {
        let time_s: Vec<f64> = (0..=80).map(|row| 0.25 * f64::from(row)).collect();
        let force_n: Vec<f64> = (0..=80).map(|row| if row / 20 % 2 == 0 { 4.6e-6 } else { -4.6e-6 }).collect();
        let force = Force::from(&force_n);
        let clock = Clock::finer(&time_s, force);
        let mut stages = Stages::of_law(BaseLaw::Lethersich.elements(&[3.5, 1.4, 47.0].map(Dual::constant)));
        let commanded = stages.clone();
        stages.load.delay_s = 0.137.into();
        stages.load.positive_factor = 1.1.into();
        stages.load.negative_factor = 0.9.into();
        stages.load.offset_n = 3e-7.into();
        for lag_s in [0.0, 0.05, 0.4] {
            stages.load.lag_time_s = lag_s.into();
            let exact = Response::new(&time_s, force, time_s.len()).trajectory_m(&stages, 549.0).expect("a trajectory");
            let (asked_s, asked_n, rows) = clock.acting(&time_s, force, &stages.load);
            let x =
                Response::new(&asked_s, &asked_n, asked_s.len()).trajectory_m(&commanded, 549.0).expect("a trajectory");
            let most = exact.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
            let worst = rows.iter().zip(&exact).fold(0.0_f64, |worst, (row, exact)| worst.max((x[*row] - exact).abs()));
            assert!(worst < 2e-4 * most, "{lag_s}: {:e}", worst / most);
        }
    }
}
