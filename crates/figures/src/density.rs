//! Kernel density estimates from draws, on grids. The bandwidths are small enough to keep the peaks of a density separate.

use super::contour::Grid;
pub use base::parameter::Support;

/// Number of cells of the grid for a marginal density.
const CELLS_1D: usize = 1024;
/// Number of cells along each axis of the grid for a joint density.
const CELLS_2D: usize = 192;
/// Number of cells of the histogram from which the bandwidth is computed.
const CELLS_BANDWIDTH: usize = 512;
/// Half-width of the Gaussian kernel, in bandwidths. Beyond it the kernel is zero.
const KERNEL_REACH: f64 = 4.5;
/// Absolute correlation above which a joint density is estimated in coordinates that are rotated by 45°.
const STRONG_CORRELATION: f64 = 0.5;

/// Estimates the range of possible values from ascending draws. The range starts at zero if all draws are non-negative and many are close to zero. Otherwise it
/// is unbounded.
pub fn estimate_support(sorted: &[f64]) -> Support {
    let (least, low, middle) =
        (quantile_of_sorted(sorted, 0.0), quantile_of_sorted(sorted, 0.05), quantile_of_sorted(sorted, 0.5));
    let lower = if least >= 0.0 && low < 0.25 * middle { 0.0 } else { f64::NEG_INFINITY };
    Support { lower, ..Support::REAL }
}

/// Quantile of ascending values, by linear interpolation between neighbouring values; NaN without values.
pub fn quantile_of_sorted(sorted: &[f64], probability: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else { return f64::NAN };
    let position = probability.clamp(0.0, 1.0) * last as f64;
    let below = position.floor() as usize;
    let above = (below + 1).min(last);
    sorted[below] + (position - below as f64) * (sorted[above] - sorted[below])
}

/// Returns the values in ascending order.
pub fn sorted(values: &[f64]) -> Vec<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted
}

/// Bandwidth of a Gaussian kernel for ascending draws: a weighted geometric mean of the bandwidths by two rules. The diffusion estimator has the weight 3/4
/// (Botev, Grotowski and Kroese, Ann. Stat. 38:2916, 2010). It keeps modes separate, but follows the noise of correlated draws. The normal-reference rule has
/// the weight 1/4. It is robust, but merges modes.
///
/// Repeated values count once, because a sampler repeats a value when it rejects a step. If many draws lie near a hard limit, the draws are mirrored at the
/// limit. Otherwise the density's jump at the limit would reduce the bandwidth. The bandwidth is zero if all values are equal.
pub fn bandwidth(sorted: &[f64], support: Support) -> f64 {
    let distinct = 1 + sorted.windows(2).filter(|pair| pair[0] != pair[1]).count();
    let quantile = |p| quantile_of_sorted(sorted, p);
    let (low, middle, high) = (quantile(0.05), quantile(0.5), quantile(0.95));
    let mirrored: Vec<f64> = if low - support.lower < 0.25 * (middle - support.lower) {
        let below = sorted.iter().rev().map(|value| 2.0 * support.lower - value);
        below.chain(sorted.iter().copied()).collect()
    } else if support.upper - high < 0.25 * (support.upper - middle) {
        let above = sorted.iter().rev().map(|value| 2.0 * support.upper - value);
        sorted.iter().copied().chain(above).collect()
    } else {
        return unbounded_bandwidth(sorted, distinct);
    };
    unbounded_bandwidth(&mirrored, distinct)
}

fn unbounded_bandwidth(sorted: &[f64], distinct: usize) -> f64 {
    let n = distinct as f64;
    let mean = sorted.iter().sum::<f64>() / sorted.len() as f64;
    let variance = sorted.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / sorted.len() as f64;
    let quartiles = quantile_of_sorted(sorted, 0.75) - quantile_of_sorted(sorted, 0.25);
    let spread = if quartiles > 0.0 { variance.sqrt().min(quartiles / 1.349) } else { variance.sqrt() };
    if distinct < 2 || spread <= 0.0 {
        return 0.0;
    }
    let normal_reference = spread * (4.0 / (3.0 * n)).powf(0.2);
    diffusion_bandwidth(sorted, n)
        .map_or(normal_reference, |diffusion| normal_reference.powf(0.25) * diffusion.min(normal_reference).powf(0.75))
}

/// Bandwidth of Botev's diffusion estimator for `n` distinct draws; `None` if the search interval does not contain its fixed point.
fn diffusion_bandwidth(sorted: &[f64], n: f64) -> Option<f64> {
    let (lower, upper) = (sorted.first()?, sorted.last()?);
    let margin = 0.1 * (upper - lower);
    let (origin, range) = (lower - margin, upper - lower + 2.0 * margin);
    let mut histogram = vec![0.0; CELLS_BANDWIDTH];
    for value in sorted {
        let cell = ((value - origin) / range * CELLS_BANDWIDTH as f64) as usize;
        histogram[cell.min(CELLS_BANDWIDTH - 1)] += 1.0 / sorted.len() as f64;
    }
    let squares = squared_cosine_coefficients(&histogram);
    let excess = |t: f64| t - diffusion_time(t, n, &squares);
    // t is the squared bandwidth divided by the squared range. The estimate of t is above t itself at the lower end of the bracket, and below it at the upper
    // end.
    let (mut low, mut high) = (1e-8, 0.05);
    if excess(low) > 0.0 || excess(high) < 0.0 {
        return None;
    }
    for _ in 0..60 {
        let middle = f64::sqrt(low * high);
        if excess(middle) < 0.0 { low = middle } else { high = middle }
    }
    Some(high.sqrt() * range)
}

/// Squares (a_k/2)² for k = 1, 2, …, with the coefficients a_k of the histogram's discrete cosine transform.
fn squared_cosine_coefficients(histogram: &[f64]) -> Vec<f64> {
    let n = histogram.len();
    let cosines: Vec<f64> = (0..4 * n).map(|i| (std::f64::consts::PI * i as f64 / (2 * n) as f64).cos()).collect();
    let coefficient =
        |k: usize| histogram.iter().enumerate().map(|(j, h)| h * cosines[k * (2 * j + 1) % (4 * n)]).sum::<f64>();
    (1..n).map(|k| coefficient(k).powi(2)).collect()
}

/// Optimal diffusion time (squared bandwidth divided by the squared range) that follows from a pilot time `t`. Five stages of plug-in estimates give the
/// squared norms of the density's derivatives.
fn diffusion_time(t: f64, n: f64, squares: &[f64]) -> f64 {
    use std::f64::consts::PI;
    let squared_norm = |s: i32, time: f64| {
        let terms = squares.iter().enumerate().map(|(i, square)| {
            let frequency = ((i + 1) as f64).powi(2);
            frequency.powi(s) * square * (-frequency * PI * PI * time).exp()
        });
        2.0 * PI.powi(2 * s) * terms.sum::<f64>()
    };
    let mut norm = squared_norm(7, t);
    for s in (2..=6).rev() {
        let odd_factorial: f64 = (1..=s).map(|i| f64::from(2 * i - 1)).product();
        let constant = (1.0 + 0.5f64.powf(f64::from(s) + 0.5)) / 3.0;
        let kernel = odd_factorial / (2.0 * PI).sqrt();
        let time = (2.0 * constant * kernel / (n * norm)).powf(2.0 / f64::from(3 + 2 * s));
        norm = squared_norm(s, time);
    }
    (2.0 * n * PI.sqrt() * norm).powf(-0.4)
}

/// Marginal density of a parameter at equidistant values.
#[derive(Debug, Clone)]
pub struct Marginal {
    /// Parameter values, equidistant and ascending.
    pub x: Vec<f64>,
    /// Density at the values `x`, in the inverse unit of `x`. Its integral is 1.
    pub density: Vec<f64>,
}

/// Kernel estimate of a marginal density from ascending draws; `None` if all draws are equal.
///
/// The grid includes all draws except extreme outliers. It is at most five times as long as the central 99 % interval.
pub fn marginal(sorted: &[f64], support: Support) -> Option<Marginal> {
    // The bandwidth is a fifth above the one with the smallest mean error, because readers would take ripples for features.
    let width = 1.2 * bandwidth(sorted, support);
    if width <= 0.0 {
        return None;
    }
    let axis = GridAxis::over(sorted, width, support, CELLS_1D);
    let mut mass = vec![0.0; axis.cells];
    for &value in sorted {
        if let Some(cell) = axis.cell(value) {
            mass[cell] += 1.0 / sorted.len() as f64;
        }
    }
    let mut density = axis.smooth(&mass);
    density.iter_mut().for_each(|d| *d /= axis.step);
    Some(Marginal { x: (0..axis.cells).map(|i| axis.centre(i)).collect(), density })
}

/// Kernel estimate of the joint density of two parameters, on a grid in coordinates without strong correlation.
#[derive(Debug, Clone)]
pub struct JointDensity {
    grid: Grid,
    frame: Frame,
    horizontal: GridAxis,
    vertical: GridAxis,
    /// Density at every draw, in ascending order.
    at_draws: Vec<f64>,
}

impl JointDensity {
    /// Kernel estimate from pairs of draws; `None` if `x` or `y` is constant.
    pub fn new(x: &[f64], y: &[f64], support_x: Support, support_y: Support) -> Option<Self> {
        let frame = Frame::new(x, y)?;
        let (a, b): (Vec<f64>, Vec<f64>) = x.iter().zip(y).map(|(&x, &y)| frame.forward(x, y)).unzip();
        let (limits_a, limits_b) = frame.supports(support_x, support_y);
        // For a pair of parameters the bandwidth is proportional to n^(−1/6), for a single one to (4/3)^(1/5) n^(−1/5). It is enlarged by another quarter,
        // because a contour shows every ripple. The threshold uses the density at the draws, which compensates for the larger bandwidth.
        let wider = 1.25 * (a.len() as f64).powf(1.0 / 5.0 - 1.0 / 6.0) / (4.0f64 / 3.0).powf(0.2);
        let axis = |values: &[f64], limits| {
            let ascending = sorted(values);
            let width = wider * bandwidth(&ascending, limits);
            (width > 0.0).then(|| GridAxis::over(&ascending, width, limits, CELLS_2D))
        };
        let (horizontal, vertical) = (axis(&a, limits_a)?, axis(&b, limits_b)?);
        let mut values = vec![0.0; horizontal.cells * vertical.cells];
        for (&a, &b) in a.iter().zip(&b) {
            if let (Some(i), Some(j)) = (horizontal.cell(a), vertical.cell(b)) {
                values[j * horizontal.cells + i] += 1.0;
            }
        }
        smooth_rows(&mut values, &horizontal);
        let mut turned = transposed(&values, horizontal.cells, vertical.cells);
        smooth_rows(&mut turned, &vertical);
        let grid = Grid {
            columns: horizontal.cells,
            rows: vertical.cells,
            values: transposed(&turned, vertical.cells, horizontal.cells),
        };
        let position = |a: f64, b: f64| (horizontal.position(a), vertical.position(b));
        let at_draws = sorted(&a.iter().zip(&b).map(|(&a, &b)| grid.interpolate(position(a, b))).collect::<Vec<_>>());
        Some(Self { grid, frame, horizontal, vertical, at_draws })
    }

    /// Density level that the fraction `mass` of the draws exceeds (Hyndman, Am. Stat. 50:120, 1996). It is computed from the density at the draws, so
    /// smoothing does not change the fraction inside a contour.
    pub fn threshold(&self, mass: f64) -> f64 {
        quantile_of_sorted(&self.at_draws, 1.0 - mass)
    }

    /// Closed loops around the region of highest density that contains the fraction `mass` of the draws. Points are in the units of `x` and `y`.
    pub fn contour(&self, mass: f64) -> Vec<Vec<(f64, f64)>> {
        let to_data =
            |(column, row): (f64, f64)| self.frame.backward(self.horizontal.value(column), self.vertical.value(row));
        let loops = self.grid.contour(self.threshold(mass));
        loops.into_iter().map(|points| points.into_iter().map(to_data).collect()).collect()
    }

    /// Returns whether a point lies outside the region that a contour encloses. `threshold` is the [`JointDensity::threshold`] of this contour.
    pub fn is_outside(&self, x: f64, y: f64, threshold: f64) -> bool {
        let (a, b) = self.frame.forward(x, y);
        self.grid.interpolate((self.horizontal.position(a), self.vertical.position(b))) < threshold
    }
}

/// Standardised coordinates of two parameters, rotated by 45° if their correlation is strong. A kernel along the original axes would blur a narrow diagonal
/// ridge. For two standardised variables the diagonals are the principal axes.
#[derive(Debug, Clone, Copy)]
struct Frame {
    mean: (f64, f64),
    sd: (f64, f64),
    turned: bool,
}

impl Frame {
    fn new(x: &[f64], y: &[f64]) -> Option<Self> {
        let n = x.len() as f64;
        let mean = (x.iter().sum::<f64>() / n, y.iter().sum::<f64>() / n);
        let moment =
            |p: &[f64], q: &[f64], mp: f64, mq: f64| p.iter().zip(q).map(|(p, q)| (p - mp) * (q - mq)).sum::<f64>() / n;
        let sd = (moment(x, x, mean.0, mean.0).sqrt(), moment(y, y, mean.1, mean.1).sqrt());
        if !(sd.0 > 0.0 && sd.1 > 0.0 && sd.0.is_finite() && sd.1.is_finite()) {
            return None;
        }
        let correlation = moment(x, y, mean.0, mean.1) / (sd.0 * sd.1);
        Some(Self { mean, sd, turned: correlation.abs() > STRONG_CORRELATION })
    }

    fn forward(&self, x: f64, y: f64) -> (f64, f64) {
        let (u, v) = ((x - self.mean.0) / self.sd.0, (y - self.mean.1) / self.sd.1);
        if self.turned { (u + v, u - v) } else { (u, v) }
    }

    fn backward(&self, a: f64, b: f64) -> (f64, f64) {
        let (u, v) = if self.turned { ((a + b) / 2.0, (a - b) / 2.0) } else { (a, b) };
        (self.mean.0 + u * self.sd.0, self.mean.1 + v * self.sd.1)
    }

    /// Hard limits of both parameters in the frame's coordinates; none after a rotation, which makes the limits oblique. The drawing is then clipped instead.
    fn supports(&self, x: Support, y: Support) -> (Support, Support) {
        if self.turned {
            return (Support::default(), Support::default());
        }
        let limits =
            |s: Support, mean: f64, sd: f64| Support { lower: (s.lower - mean) / sd, upper: (s.upper - mean) / sd };
        (limits(x, self.mean.0, self.sd.0), limits(y, self.mean.1, self.sd.1))
    }
}

/// Equidistant cells along one coordinate, with the kernel that smooths along it.
#[derive(Debug, Clone)]
struct GridAxis {
    origin: f64,
    step: f64,
    cells: usize,
    kernel: Vec<f64>,
    reflects: (bool, bool),
}

impl GridAxis {
    fn over(sorted: &[f64], bandwidth: f64, support: Support, cells: usize) -> Self {
        let quantile = |p| quantile_of_sorted(sorted, p);
        let (inner_lower, inner_upper) = (quantile(0.005), quantile(0.995));
        let slack = 2.0 * (inner_upper - inner_lower) + KERNEL_REACH * bandwidth;
        let lower = quantile(0.0).max(inner_lower - slack) - KERNEL_REACH * bandwidth;
        let upper = quantile(1.0).min(inner_upper + slack) + KERNEL_REACH * bandwidth;
        let reflects = (lower < support.lower, upper > support.upper);
        let (lower, upper) = (lower.max(support.lower), upper.min(support.upper));
        let step = (upper - lower) / cells as f64;
        // A kernel narrower than half a cell would make the cells visible.
        let sigma = (bandwidth / step).max(0.5);
        let reach = ((KERNEL_REACH * sigma).ceil() as usize).min(cells - 1);
        let raw: Vec<f64> = (0..=reach).map(|i| (-0.5 * (i as f64 / sigma).powi(2)).exp()).collect();
        let total = raw[0] + 2.0 * raw[1..].iter().sum::<f64>();
        Self { origin: lower, step, cells, kernel: raw.into_iter().map(|k| k / total).collect(), reflects }
    }

    fn centre(&self, cell: usize) -> f64 {
        self.value(cell as f64)
    }
    /// Coordinate of a position, which is counted in cells from the centre of the first cell.
    fn value(&self, position: f64) -> f64 {
        self.origin + (position + 0.5) * self.step
    }
    fn position(&self, value: f64) -> f64 {
        (value - self.origin) / self.step - 0.5
    }
    fn cell(&self, value: f64) -> Option<usize> {
        let cell = ((value - self.origin) / self.step).floor();
        let at_upper_limit = cell == self.cells as f64 && self.reflects.1;
        if at_upper_limit {
            Some(self.cells - 1)
        } else {
            (cell >= 0.0 && cell < self.cells as f64).then_some(cell as usize)
        }
    }

    /// Cell that receives the mass moved to the cell index `target`. Mass beyond a hard limit is reflected. `None` if the mass leaves the grid.
    fn folded(&self, target: isize) -> Option<usize> {
        let n = self.cells as isize;
        let folded = match target {
            t if t < 0 && self.reflects.0 => -t - 1,
            t if t >= n && self.reflects.1 => 2 * n - 1 - t,
            t => t,
        };
        usize::try_from(folded).ok().filter(|cell| *cell < self.cells)
    }

    /// Convolves the mass in the cells with the kernel. Mass that crosses a hard limit is reflected. The other ends of the grid are far from the draws.
    fn smooth(&self, mass: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; self.cells];
        for (i, &m) in mass.iter().enumerate().filter(|(_, m)| **m != 0.0) {
            out[i] += m * self.kernel[0];
            for (k, &weight) in self.kernel.iter().enumerate().skip(1) {
                for target in [i as isize - k as isize, i as isize + k as isize] {
                    if let Some(cell) = self.folded(target) {
                        out[cell] += m * weight;
                    }
                }
            }
        }
        out
    }
}

fn smooth_rows(values: &mut [f64], axis: &GridAxis) {
    for row in values.chunks_exact_mut(axis.cells) {
        let smoothed = axis.smooth(row);
        row.copy_from_slice(&smoothed);
    }
}

fn transposed(values: &[f64], columns: usize, rows: usize) -> Vec<f64> {
    (0..columns).flat_map(|i| (0..rows).map(move |j| values[j * columns + i])).collect()
}

#[cfg(test)]
#[path = "density_tests.rs"]
mod tests;
