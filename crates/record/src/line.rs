//! Least-squares fit of a straight line.

/// Least-squares line through values x over times t: x = mean + slope (t − mean time).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionLine {
    mean_s: f64,
    mean: f64,
    /// Slope of the line, in units of the values per second.
    pub slope_per_s: f64,
    /// Sum Σ (t − mean time)² over the points' times t, in s². The variance of the slope is the variance of one value, divided by this sum.
    pub spread_s2: f64,
}

impl MotionLine {
    /// Fits a line to points, each a time in s and a value in any unit. At least two times must differ.
    pub fn through(points: impl Iterator<Item = (f64, f64)> + Clone) -> Self {
        let n = points.clone().count() as f64;
        let mean_s = points.clone().map(|(t, _)| t).sum::<f64>() / n;
        let mean = points.clone().map(|(_, x)| x).sum::<f64>() / n;
        let covariance: f64 = points.clone().map(|(t, x)| (t - mean_s) * (x - mean)).sum();
        let spread_s2: f64 = points.map(|(t, _)| (t - mean_s).powi(2)).sum();
        Self { mean_s, mean, slope_per_s: covariance / spread_s2, spread_s2 }
    }

    /// Value of the line at the time `time_s` (s).
    pub fn at(&self, time_s: f64) -> f64 {
        self.mean + self.slope_per_s * (time_s - self.mean_s)
    }

    /// Residual of a point: its value minus the line at its time. The point is a time in s and a value.
    pub fn excess(&self, (time_s, value): (f64, f64)) -> f64 {
        value - self.mean - self.slope_per_s * (time_s - self.mean_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Compares a line with normal equations solved by hand: t = 0, 1, 3 and x = 1, 2, 6 give x = 5/7 + 12/7 t.
    #[test]
    fn the_normal_equations_hold() {
        let points = [(0.0, 1.0), (1.0, 2.0), (3.0, 6.0)];
        let line = MotionLine::through(points.into_iter());
        assert!((line.slope_per_s - 12.0 / 7.0).abs() < 1e-15 && (line.spread_s2 - 14.0 / 3.0).abs() < 1e-14);
        assert!((line.at(0.0) - 5.0 / 7.0).abs() < 1e-15);
        let excesses = points.map(|point| line.excess(point));
        assert!(excesses.iter().sum::<f64>().abs() < 1e-15 && (excesses[0] - 2.0 / 7.0).abs() < 1e-15);
    }
}
