//! Scales that map values to an axis, and the round numbers that are marked on the axis.

use super::font::text_width_px;
use super::number;

const ALL_DIGITS: [f64; 9] = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0];
/// Choices of digits that are labelled in each decade if there are few decades. The first choice with a suitable number of labels is used.
const DIGITS_OF_A_DECADE: [&[f64]; 4] = [&[1.0, 2.0, 5.0], &ALL_DIGITS, &[1.0, 3.0], &[1.0]];

/// Fraction of a logarithmic axis's length by which wide intervals may extend the axis at each end. `STRETCH_FACTORS` limits the extension, as ratios of
/// values.
const AXIS_EXTENSION: f64 = 0.5;
const STRETCH_FACTORS: (f64, f64) = (1.25, 5.0);

/// Largest and smallest absolute value on an axis. Outside this range, ratios and powers of values leave the range of floating-point numbers.
const LARGEST: f64 = 1e290;
const SMALLEST: f64 = 1e-290;
/// Smallest length of an axis divided by its largest value. On a shorter axis both ends would have equal labels.
const NARROWEST: f64 = 1e-9;

/// Kind of a scale: linear or logarithmic.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ScaleKind {
    /// Linear scale: equal differences have equal lengths.
    Linear,
    /// Logarithmic scale: equal ratios have equal lengths. Both ends are positive.
    Log10,
}

/// Range of values on an axis, and the kind of its scale.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisScale {
    /// Kind of the scale.
    pub kind: ScaleKind,
    /// Value at the start of the axis.
    pub lower: f64,
    /// Value at the end of the axis, above `lower`.
    pub upper: f64,
}

/// Marks of an axis with their labels.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Ticks {
    /// Value and label of each labelled mark. A label may be empty.
    pub major: Vec<(f64, String)>,
    /// Values of the marks without a label.
    pub minor: Vec<f64>,
    /// Common factor of all labels, such as `×10ⁿ`; empty if there is none.
    pub factor: String,
}

impl AxisScale {
    /// Linear scale from `lower` to `upper`. A range that is empty or not finite is changed so that it can be drawn.
    pub fn linear(lower: f64, upper: f64) -> Self {
        let (lower, upper) = if lower.is_finite() && upper.is_finite() { (lower, upper) } else { (0.0, 1.0) };
        // The difference between both ends must be finite, and its digits must be representable.
        let drawable = |value: f64| if value.abs() < SMALLEST { 0.0 } else { value.clamp(-LARGEST, LARGEST) };
        let (lower, upper) = (drawable(lower), drawable(upper));
        let (lower, upper) = if lower <= upper { (lower, upper) } else { (upper, lower) };
        let smallest = NARROWEST * lower.abs().max(upper.abs());
        if upper - lower > smallest {
            return Self { kind: ScaleKind::Linear, lower, upper };
        }
        let half = if smallest > 0.0 { 0.05 * lower.abs().max(upper.abs()) } else { 0.5 };
        Self { kind: ScaleKind::Linear, lower: lower - half, upper: upper + half }
    }

    /// Linear scale that includes all finite `values`. A margin, given as a fraction of the range, is added at both ends.
    pub fn over(values: impl IntoIterator<Item = f64>, margin: f64) -> Self {
        let finite = values.into_iter().filter(|value| value.is_finite());
        let (lower, upper) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, u), v| (l.min(v), u.max(v)));
        let pad = margin * (upper - lower);
        Self::linear(lower - pad, upper + pad)
    }

    /// Logarithmic scale from `lower` to `upper`. An end that is not positive is replaced by the smallest number that can be drawn.
    pub fn log10(lower: f64, upper: f64) -> Self {
        let lower = if lower > SMALLEST { lower.min(0.1 * LARGEST) } else { SMALLEST };
        let upper = if upper > lower * (1.0 + NARROWEST) { upper.min(LARGEST) } else { 10.0 * lower };
        Self { kind: ScaleKind::Log10, lower, upper }
    }

    /// Logarithmic scale that includes all positive `estimates`. It extends towards the ends of `intervals` only up to a limit, because a single wide interval
    /// would compress all others. It also includes `others` that are near enough.
    pub fn log10_around(
        estimates: impl Iterator<Item = f64>,
        intervals: impl Iterator<Item = f64>,
        others: impl Iterator<Item = f64>,
    ) -> Self {
        let over = |values: &mut dyn Iterator<Item = f64>| {
            values.map(f64::ln).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, u), v| (l.min(v), u.max(v)))
        };
        let (lower, upper) = over(&mut estimates.filter(|value| *value > 0.0 && value.is_finite()));
        if lower > upper {
            return Self::log10(1.0, 10.0);
        }
        let stretch = (AXIS_EXTENSION * (upper - lower)).clamp(STRETCH_FACTORS.0.ln(), STRETCH_FACTORS.1.ln());
        let (lowest, highest) = (lower - stretch, upper + stretch);
        let near = others.filter(|value| (lowest..=highest).contains(&value.ln()));
        let (least, most) = over(&mut intervals.chain(near));
        let (lower, upper) = (lower.min(least.max(lowest)), upper.max(most.min(highest)));
        let pad = 0.04 * (upper - lower) + 1e-3;
        Self::log10((lower - pad).exp(), (upper + pad).exp())
    }

    /// Position of `value` on the axis: 0 at the start, 1 at the end.
    pub fn fraction(&self, value: f64) -> f64 {
        match self.kind {
            ScaleKind::Linear => (value - self.lower) / (self.upper - self.lower),
            ScaleKind::Log10 => {
                let (lower, upper) = (self.lower.log10(), self.upper.log10());
                (value.max(f64::MIN_POSITIVE).log10() - lower) / (upper - lower)
            }
        }
    }

    /// Largest distance between two curves, as a fraction of the axis. Distances that are not finite are left out.
    pub fn largest_distance(&self, lower: &[f64], upper: &[f64]) -> f64 {
        let distances = lower.iter().zip(upper).map(|(lower, upper)| self.fraction(*upper) - self.fraction(*lower));
        distances.filter(|distance| distance.is_finite()).fold(0.0, f64::max)
    }

    /// Returns the marks at round numbers. At most `most` of them have labels.
    pub fn ticks(&self, most: usize) -> Ticks {
        match self.kind {
            ScaleKind::Linear => self.linear_ticks(most.max(2)),
            ScaleKind::Log10 => self.log_ticks(most.max(2)),
        }
    }

    /// Returns marks whose labels are side by side along an axis of `length_px`, with the font size `size_px`. Labels do not touch, and extend beyond the axis
    /// by at most `overhang_px`.
    pub fn ticks_side_by_side(&self, most: usize, length_px: f64, size_px: f64, overhang_px: f64) -> Ticks {
        let gap_px = 0.9 * size_px;
        let most = most.max(2);
        let half_px = |label: &str| text_width_px(label, size_px) / 2.0;
        let middle_px = |value: f64| self.fraction(value) * length_px;
        // Marks whose labels stay within the overhang, and whether the labels touch.
        let fitted = |candidate: usize| {
            let mut ticks = self.ticks(candidate);
            let (mut previous_end, mut is_free) = (f64::NEG_INFINITY, true);
            for (value, label) in &mut ticks.major {
                let (middle, half) = (middle_px(*value), half_px(label));
                if middle - half < -overhang_px || middle + half > length_px + overhang_px {
                    label.clear();
                } else if !label.is_empty() {
                    is_free &= middle - half > previous_end + gap_px;
                    previous_end = middle + half;
                }
            }
            (ticks, is_free)
        };
        let shown = |ticks: &Ticks| ticks.major.iter().filter(|(_, label)| !label.is_empty()).count();
        // The search starts with two more labels than allowed, because labels at the ends may be removed.
        let free = (2..=most + 2).rev().map(fitted).filter(|(_, is_free)| *is_free).map(|(ticks, _)| ticks);
        if let Some(ticks) = free.into_iter().find(|ticks| (2..=most).contains(&shown(ticks))) {
            return ticks;
        }
        // Long labels: of each number of marks, those are labelled that do not touch the label before; half the gap must do.
        let thinned = |candidate: usize| {
            let (mut ticks, _) = fitted(candidate);
            let mut previous_end = f64::NEG_INFINITY;
            for (value, label) in ticks.major.iter_mut().filter(|(_, label)| !label.is_empty()) {
                let (middle, half) = (middle_px(*value), half_px(label));
                if middle - half > previous_end + 0.5 * gap_px {
                    previous_end = middle + half;
                } else {
                    label.clear();
                }
            }
            ticks
        };
        (2..=4 * most).map(thinned).max_by_key(shown).unwrap_or_default()
    }

    fn linear_ticks(&self, most: usize) -> Ticks {
        let step = round_step(self.lower, self.upper, most);
        let exponent = number::factored_exponent(self.lower.abs().max(self.upper.abs()));
        let scale = 10f64.powi(exponent);
        let decimals = (-number::decimal_exponent(step / scale * (1.0 + 1e-9))).max(0) as usize;
        let label = |value: f64| number::format_decimals(value / scale, decimals);
        let minor_step = step / if leading_digit(step) == 2 { 4.0 } else { 5.0 };
        Ticks {
            major: multiples(step, self.lower, self.upper).map(|value| (value, label(value))).collect(),
            minor: multiples(minor_step, self.lower, self.upper).collect(),
            factor: if exponent == 0 { String::new() } else { format!("×{}", number::power_of_ten(exponent)) },
        }
    }

    fn log_ticks(&self, most: usize) -> Ticks {
        let inside = |value: f64| value >= self.lower * (1.0 - 1e-9) && value <= self.upper * (1.0 + 1e-9);
        let decades = self.lower.log10().floor() as i32..=self.upper.log10().ceil() as i32;
        let powers: Vec<i32> = decades.clone().filter(|&n| inside(10f64.powi(n))).collect();
        let every = powers.len().div_ceil(most).max(1) as i32;
        let of_decades = |digits: &[f64]| {
            let of_decade = |n: i32| digits.iter().map(move |digit| digit * 10f64.powi(n)).collect::<Vec<f64>>();
            decades.clone().flat_map(of_decade).filter(|&v| inside(v)).collect::<Vec<f64>>()
        };
        let powers_of_ten = || {
            let labelled = powers.iter().filter(|&&n| n.rem_euclid(every) == 0);
            labelled.map(|&n| (10f64.powi(n), number::power_of_ten(n)))
        };
        // Over few decades, labels at powers of ten alone would be at most two.
        if powers.len() < 4 {
            let readable = |digits: &[f64]| (2..=most).contains(&of_decades(digits).len());
            let Some(digits) = DIGITS_OF_A_DECADE.into_iter().find(|digits| readable(digits)) else {
                return self.linear_ticks(most);
            };
            let exponent = number::factored_exponent(self.upper);
            let label = |value: f64| (value, number::format_significant(value / 10f64.powi(exponent), 1));
            // Labels at exactly three powers of ten have the form that more powers have.
            if powers.len() == 3 && digits.len() == 1 {
                return Ticks {
                    major: powers_of_ten().collect(),
                    minor: of_decades(&ALL_DIGITS),
                    factor: String::new(),
                };
            }
            return Ticks {
                major: of_decades(digits).into_iter().map(label).collect(),
                minor: of_decades(&ALL_DIGITS),
                factor: if exponent == 0 { String::new() } else { format!("×{}", number::power_of_ten(exponent)) },
            };
        }
        let minor = if every == 1 { of_decades(&ALL_DIGITS) } else { powers.iter().map(|&n| 10f64.powi(n)).collect() };
        Ticks { major: powers_of_ten().collect(), minor, factor: String::new() }
    }
}

/// Smallest step of 1, 2 or 5 × 10ⁿ that has at most `most` multiples between `lower` and `upper`.
fn round_step(lower: f64, upper: f64, most: usize) -> f64 {
    let span = upper - lower;
    let mut exponent = number::decimal_exponent(span / most as f64) - 1;
    loop {
        for digit in [1.0, 2.0, 5.0] {
            let step = digit * 10f64.powi(exponent);
            if multiples(step, lower, upper).take(most + 1).count() <= most {
                return step;
            }
        }
        exponent += 1;
    }
}

fn leading_digit(step: f64) -> i64 {
    (step / 10f64.powi(number::decimal_exponent(step * (1.0 + 1e-9)))).round() as i64
}

/// Multiples of `step` between `lower` and `upper`. Multiplication avoids the rounding errors that repeated addition accumulates.
fn multiples(step: f64, lower: f64, upper: f64) -> impl Iterator<Item = f64> {
    let tolerance = 1e-6;
    let (first, last) = ((lower / step - tolerance).ceil(), (upper / step + tolerance).floor());
    let count = if last >= first { (last - first) as usize + 1 } else { 0 };
    (0..count).map(move |i| (first + i as f64) * step)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(ticks: &Ticks) -> Vec<&str> {
        ticks.major.iter().map(|(_, label)| label.as_str()).collect()
    }

    #[test]
    fn linear_marks_are_round_and_not_too_many() {
        assert_eq!(labels(&AxisScale::linear(-0.21, 1.03).ticks(6)), ["0.0", "0.5", "1.0"]);
        assert_eq!(
            labels(&AxisScale::linear(-0.21, 1.03).ticks(7)),
            ["−0.2", "0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]
        );
        for (lower, upper) in [(3.2, 3.9), (0.0, 1e-7), (-1e9, 1e9), (1_000_000.0, 1_000_000.5), (46.0, 49.7)] {
            for most in 2..9 {
                let ticks = AxisScale::linear(lower, upper).ticks(most);
                assert!(ticks.major.len() <= most && !ticks.major.is_empty(), "{lower} {upper} {most}");
                let distinct: std::collections::BTreeSet<_> = labels(&ticks).into_iter().collect();
                assert_eq!(distinct.len(), ticks.major.len(), "{ticks:?}");
            }
        }
        assert_eq!(AxisScale::linear(0.0, 1e-7).ticks(6).factor, "×10⁻⁷");
    }

    #[test]
    fn log_marks_are_powers_of_ten() {
        assert_eq!(labels(&AxisScale::log10(3e-4, 20.0).ticks(8)), ["10⁻³", "10⁻²", "10⁻¹", "10⁰", "10¹"]);
        assert_eq!(labels(&AxisScale::log10(0.9, 8.0).ticks(8)), ["1", "2", "5"]);
        assert!(AxisScale::log10(1e-18, 1.0).ticks(7).major.len() <= 7);
    }

    #[test]
    fn logarithmic_axes_over_few_decades_have_more_than_one_number() {
        assert_eq!(labels(&AxisScale::log10(0.8, 12.0).ticks(5)), ["1", "2", "5", "10"]);
        assert_eq!(labels(&AxisScale::log10(0.15, 90.0).ticks(5)), ["0.3", "1", "3", "10", "30"]);
        let tiny = AxisScale::log10(2e-8, 4e-6).ticks(5);
        assert_eq!((labels(&tiny).join(" "), tiny.factor.as_str()), ("0.03 0.1 0.3 1 3".into(), "×10⁻⁶"));
        assert_eq!(labels(&AxisScale::log10(2.1, 4.7).ticks(5)), ["3", "4"]);
        assert_eq!(labels(&AxisScale::log10(3.31, 3.49).ticks(5)), ["3.35", "3.40", "3.45"]);
        for k in 0..400 {
            let (lower, ratio) = (10f64.powf(0.01 * f64::from(k)), 1.01 + 0.07 * f64::from(k));
            let n = AxisScale::log10(lower, lower * ratio).ticks(5).major.len();
            assert!((2..=5).contains(&n), "{n} numbers from {lower} to {}", lower * ratio);
        }
    }

    #[test]
    fn vague_intervals_lengthen_an_axis_to_some_degree() {
        let around = |interval: [f64; 2], other: f64| {
            let scale = AxisScale::log10_around([1.0, 100.0].into_iter(), interval.into_iter(), [other].into_iter());
            (scale.lower, scale.upper)
        };
        let (lower, upper) = around([0.5, 200.0], 50.0);
        assert!(lower < 0.5 && lower > 0.3 && upper > 200.0 && upper < 300.0, "{lower} {upper}");
        let (lower, upper) = around([1e-300, 1e300], 50.0);
        assert!(lower < 0.2 && lower > 0.1 && upper > 500.0 && upper < 1e3, "{lower} {upper}");
        assert_eq!(around([2.0, 3.0], 50.0), around([2.0, 3.0], 1e9));
        assert!(around([2.0, 3.0], 400.0).1 > 400.0);
    }

    #[test]
    fn labels_side_by_side_do_not_touch() {
        let scale = AxisScale::linear(1_000_000.0, 1_000_000.4);
        for length in [60.0, 120.0, 500.0] {
            let ticks = scale.ticks_side_by_side(8, length, 11.0, 6.0);
            let mut end = f64::NEG_INFINITY;
            for (value, label) in ticks.major.iter().filter(|(_, label)| !label.is_empty()) {
                let (middle, half) = (scale.fraction(*value) * length, text_width_px(label, 11.0) / 2.0);
                assert!(middle - half > end, "{length}: {ticks:?}");
                end = middle + half;
            }
        }
    }

    /// Axes of corner plots have two numbers or more at every size of panel, around values of any size, and for posteriors that are as narrow as 10⁻⁴.
    #[test]
    fn axes_of_corner_plots_have_more_than_one_number() {
        for length in [155.0, 165.0, 178.0, 200.0, 235.0, 290.0, 380.0] {
            let most = if length > 210.0 { 6 } else { 5 };
            for k in 0..600 {
                let middle = 10f64.powf(0.0203 * f64::from(k) - 6.0);
                for width in [1e-4, 1e-3, 1e-2, 0.1, 0.5, 0.9] {
                    let scale = AxisScale::linear(middle * (1.0 - width), middle * (1.0 + width));
                    let ticks = scale.ticks_side_by_side(most, length, 11.0, 5.5);
                    let shown = ticks.major.iter().filter(|(_, label)| !label.is_empty()).count();
                    assert!(
                        (2..=most).contains(&shown),
                        "{shown} numbers on {length} px around {middle} ± {width}: {ticks:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn labels_lost_at_the_ends_are_made_up_for() {
        let ticks = AxisScale::linear(2.995, 4.005).ticks_side_by_side(5, 200.0, 11.0, 5.0);
        let shown: Vec<&str> = labels(&ticks).into_iter().filter(|label| !label.is_empty()).collect();
        assert_eq!(shown, ["3.2", "3.4", "3.6", "3.8"]);
    }

    #[test]
    fn degenerate_ranges_can_be_drawn() {
        let extreme =
            [0.0, 5.0, -1e308, f64::MAX, f64::MIN_POSITIVE, 5e-324, 1e19, 1e19 + 1e4, f64::NAN, f64::INFINITY];
        let pairs = || extreme.iter().flat_map(|lower| extreme.map(|upper| (*lower, upper)));
        let scales = pairs().flat_map(|(lower, upper)| {
            [AxisScale::linear(lower, upper), AxisScale::log10(lower, upper), AxisScale::over([lower, upper], 0.1)]
        });
        for scale in scales.chain([AxisScale::over([], 0.1)]) {
            assert!(scale.upper > scale.lower && !scale.ticks(5).major.is_empty(), "{scale:?}");
        }
    }
}
