//! Shapes of structure outside the library, and the grids on which they are searched.

use std::f64::consts::PI;
use std::ops::Range;

use super::OutsideKind;
use super::setting::SearchSetting;

/// Unit of columns, 1 µm, which gives all amplitudes similar sizes.
pub(super) const UNIT_M: f64 = 1e-6;

/// A shape with free amplitudes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum StructureShape {
    /// Sine and cosine of time.
    Vibration { frequency_hz: f64 },
    /// A shift of all positions.
    Offset,
    /// A shift of the position from one row on.
    Step { row: usize },
    /// A drift that begins at one time.
    RampFrom { time_s: f64 },
    /// A drift that ends at one time.
    RampUntil { time_s: f64 },
    /// A change of the position's scale from one row on.
    GainChange { row: usize },
    /// A bell curve in time.
    Bump { centre_s: f64, width_s: f64 },
    /// Backlash: output of the play operator less its input.
    Backlash { half_width_m: f64 },
    /// Sines and cosines with multiples of the cycle's frequency.
    CycleLocked { n_harmonics: usize },
    /// A free curve of ln(time since the force step), signed by the step.
    SinceStep { n_knots: usize },
    /// A free curve of absolute time.
    SlowChange { n_waves: usize },
    /// A power of the position: `power` of its size, times its sign if `is_odd`.
    Nonlinearity { power: i32, is_odd: bool },
    /// A separate shift for each level of the force.
    ForceLevel,
    /// Response to the square of the force, less the response to the force.
    ForceSquared,
    /// The largest excursion so far.
    Ratchet { side: Side },
    /// A free curve of the position, from its lowest to its highest.
    OfPosition { n_knots: usize },
    /// Sine and cosine of the position.
    PositionWave { period_m: f64 },
}

/// Direction of the excursions whose largest one is remembered.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Side {
    Above,
    Below,
    Both,
}

/// Largest difference of forces that belong to one level, as a fraction of the largest force.
const LEVEL_TOLERANCE: f64 = 0.05;
/// Largest number of levels with a shift each; more levels are described by powers of the force.
const MOST_LEVELS: usize = 8;
/// Distance from a bell's centre, in widths, beyond which it counts as 0: it is e⁻³² of its height there.
const WIDEST: f64 = 8.0;
/// Least number of rows before and after an event. Events with fewer rows on one side count as outliers.
const LEAST_ROWS: usize = 4;
const MOST_FREQUENCIES: usize = 1200;
/// Largest number of trial times of a ramp, and of trial rows of a step.
const MOST_MOMENTS: usize = 1000;

impl StructureShape {
    pub fn kind(self) -> OutsideKind {
        match self {
            Self::Vibration { .. } => OutsideKind::Vibration,
            Self::Offset => OutsideKind::Offset,
            Self::Step { .. } => OutsideKind::Slip,
            Self::RampFrom { .. } | Self::RampUntil { .. } => OutsideKind::Ramp,
            Self::GainChange { .. } => OutsideKind::GainChange,
            Self::Bump { .. } => OutsideKind::Disturbance,
            Self::Backlash { .. } => OutsideKind::Backlash,
            Self::CycleLocked { .. } => OutsideKind::CycleLocked,
            Self::SinceStep { .. } => OutsideKind::SinceStep,
            Self::SlowChange { .. } => OutsideKind::SlowChange,
            Self::Nonlinearity { .. } => OutsideKind::Nonlinearity,
            Self::ForceLevel | Self::ForceSquared => OutsideKind::ForceLevel,
            Self::Ratchet { .. } => OutsideKind::Ratchet,
            Self::OfPosition { .. } | Self::PositionWave { .. } => OutsideKind::Nonlinearity,
        }
    }

    /// Columns of the shape (m per unit amplitude, one value per row of the record).
    pub fn columns_m(self, setting: &SearchSetting) -> Vec<Vec<f64>> {
        let (first_s, last_s) = setting.span_s();
        let time = |row: usize| setting.time_s[row];
        let mut columns = match self {
            Self::Vibration { frequency_hz } => {
                let angle = |row: usize| 2.0 * PI * frequency_hz * (time(row) - first_s);
                vec![setting.column(|row| angle(row).sin()), setting.column(|row| angle(row).cos())]
            }
            Self::Offset => vec![setting.column(|_| 1.0)],
            Self::Step { row: from } => vec![setting.column(|row| f64::from(u8::from(row >= from)))],
            Self::RampFrom { time_s } => vec![setting.column(|row| (time(row) - time_s).max(0.0))],
            // A ramp that ends: the record begins shifted and drifts to its final position.
            Self::RampUntil { time_s } => vec![setting.column(|row| (time(row) - time_s).min(0.0))],
            Self::GainChange { row: from } => {
                let largest_m = setting.largest_position_m().max(f64::MIN_POSITIVE);
                vec![setting.column(|row| if row >= from { setting.position_m[row] / largest_m } else { 0.0 })]
            }
            Self::Bump { centre_s, width_s } => {
                let mut column = vec![0.0; setting.time_s.len()];
                self.rows(setting).for_each(|row| column[row] = bell(time(row), centre_s, width_s));
                vec![column]
            }
            Self::Backlash { half_width_m } => vec![play_less_position(&setting.position_m, half_width_m)],
            Self::CycleLocked { n_harmonics } => harmonics(setting, n_harmonics),
            Self::SinceStep { n_knots } => hats_since_step(setting, n_knots),
            Self::SlowChange { n_waves } => {
                // Beyond the fitted rows the curve stays at its last value.
                let share = |row: usize| ((time(row) - first_s) / (last_s - first_s)).clamp(0.0, 1.0);
                (1..=n_waves).map(|k| setting.column(|row| (PI * k as f64 * share(row)).cos())).collect()
            }
            Self::Nonlinearity { power, is_odd } => {
                let largest_m = setting.largest_position_m().max(f64::MIN_POSITIVE);
                let of_row = |row: usize| {
                    let ratio = setting.position_m[row] / largest_m;
                    ratio.abs().powi(power) * if is_odd { ratio.signum() } else { 1.0 }
                };
                vec![setting.column(of_row)]
            }
            Self::ForceLevel => force_levels(setting),
            Self::ForceSquared => {
                let largest_m = setting.largest_position_m().max(f64::MIN_POSITIVE);
                let moved_m = |row: usize| setting.position_of_squares_m[row] - setting.position_m[row];
                vec![setting.column(|row| moved_m(row) / largest_m)]
            }
            Self::Ratchet { side } => vec![largest_so_far(setting, side)],
            Self::OfPosition { n_knots } => hats_of_position(setting, n_knots),
            Self::PositionWave { period_m } => {
                let angle = |row: usize| 2.0 * PI * setting.position_m[row] / period_m;
                vec![setting.column(|row| angle(row).sin()), setting.column(|row| angle(row).cos())]
            }
        };
        columns.iter_mut().flatten().for_each(|value| *value *= UNIT_M);
        columns
    }

    /// Rows in which the shape differs from 0, up to rounding.
    pub fn rows(self, setting: &SearchSetting) -> Range<usize> {
        match self {
            Self::Bump { centre_s, width_s } => {
                let before = |time_s: f64| setting.time_s.partition_point(|other| *other < time_s);
                before(centre_s - WIDEST * width_s)..before(centre_s + WIDEST * width_s)
            }
            _ => 0..setting.time_s.len(),
        }
    }

    /// Columns of the shape in a range of rows that contains [`StructureShape::rows`].
    pub fn columns_in_m(self, setting: &SearchSetting, rows: Range<usize>) -> Vec<Vec<f64>> {
        match self {
            Self::Bump { centre_s, width_s } => {
                vec![rows.map(|row| UNIT_M * bell(setting.time_s[row], centre_s, width_s)).collect()]
            }
            _ => self.columns_m(setting),
        }
    }

    /// Returns neighbouring shapes on a finer grid, including this one; empty for shapes without a grid.
    pub fn neighbours(self, setting: &SearchSetting, fineness: f64) -> Vec<Self> {
        let (first_s, last_s) = setting.span_s();
        let offsets = || (-4..=4).map(|k| fineness * f64::from(k) / 4.0);
        match self {
            Self::Vibration { frequency_hz } => {
                let spacing_hz = 0.5 / (last_s - first_s);
                offsets().map(|by| Self::Vibration { frequency_hz: frequency_hz + by * spacing_hz }).collect()
            }
            Self::Bump { centre_s, width_s } => offsets()
                .flat_map(|by| {
                    [-1.0_f64, -0.5, 0.0, 0.5, 1.0].map(|wider| Self::Bump {
                        centre_s: centre_s + by * width_s,
                        width_s: (width_s * (0.35 * fineness * wider).exp()).max(NARROWEST * setting.interval_s),
                    })
                })
                .collect(),
            Self::RampFrom { time_s } => {
                offsets().map(|by| Self::RampFrom { time_s: time_s + by * ramp_spacing_s(setting) }).collect()
            }
            Self::RampUntil { time_s } => {
                offsets().map(|by| Self::RampUntil { time_s: time_s + by * ramp_spacing_s(setting) }).collect()
            }
            Self::Backlash { half_width_m } => {
                offsets().map(|by| Self::Backlash { half_width_m: half_width_m * (0.4 * by).exp() }).collect()
            }
            Self::PositionWave { period_m } => {
                // The grid is uniform in the reciprocal period.
                let spacing = 0.5 / range_m(setting);
                let periods = offsets().map(|by| 1.0 / (1.0 / period_m + by * spacing));
                periods.filter(|period_m| *period_m > 0.0).map(|period_m| Self::PositionWave { period_m }).collect()
            }
            Self::Step { row } => near_rows(setting, row).map(|row| Self::Step { row }).collect(),
            Self::GainChange { row } => near_rows(setting, row).map(|row| Self::GainChange { row }).collect(),
            _ => Vec::new(),
        }
    }
}

/// Gaussian curve in time with height 1; 0 beyond [`WIDEST`] widths from its centre.
fn bell(time_s: f64, centre_s: f64, width_s: f64) -> f64 {
    let widths = (time_s - centre_s) / width_s;
    if widths.abs() > WIDEST { 0.0 } else { (-0.5 * widths * widths).exp() }
}

/// Fitted rows near `row` at which an event may begin.
fn near_rows(setting: &SearchSetting, row: usize) -> impl Iterator<Item = usize> {
    let rows = event_rows(setting);
    let place = rows.partition_point(|other| *other < row);
    let reach = 1 + rows.len() / MOST_MOMENTS;
    rows.iter().copied().skip(place.saturating_sub(reach)).take(place.min(reach) + reach + 1)
}

/// Rows at which an event may begin.
fn event_rows(setting: &SearchSetting) -> &[usize] {
    setting.rows.get(LEAST_ROWS..setting.rows.len().saturating_sub(LEAST_ROWS)).unwrap_or(&[])
}

fn ramp_spacing_s(setting: &SearchSetting) -> f64 {
    let (first_s, last_s) = setting.span_s();
    ((last_s - first_s) / 250.0).max(2.0 * setting.interval_s)
}

/// Output less input of the play operator, in units of its half-width. The output moves only when the input pushes against the ends of the play.
fn play_less_position(position_m: &[f64], half_width_m: f64) -> Vec<f64> {
    let mut held_m = 0.0_f64;
    let follow = |x: &f64| {
        held_m = held_m.clamp(x - half_width_m, x + half_width_m);
        (held_m - x) / half_width_m
    };
    position_m.iter().map(follow).collect()
}

fn harmonics(setting: &SearchSetting, n_harmonics: usize) -> Vec<Vec<f64>> {
    let angle = |k: usize, row: usize| 2.0 * PI * k as f64 * setting.phase[row];
    (1..=n_harmonics)
        .flat_map(|k| [setting.column(|row| angle(k, row).sin()), setting.column(|row| angle(k, row).cos())])
        .collect()
}

/// Hat functions over the logarithm of the time since the step, from a sample interval to a hold.
fn hats_since_step(setting: &SearchSetting, n_knots: usize) -> Vec<Vec<f64>> {
    let (shortest, longest) = (setting.interval_s.ln(), setting.hold_s.max(2.0 * setting.interval_s).ln());
    let spacing = (longest - shortest) / (n_knots - 1) as f64;
    let hat = |knot: usize, row: usize| {
        let (sign, since_s) = setting.since_step[row];
        if sign == 0.0 {
            return 0.0;
        }
        let place = (since_s.ln().clamp(shortest, longest) - shortest) / spacing;
        sign * (1.0 - (place - knot as f64).abs()).max(0.0)
    };
    (0..n_knots).map(|knot| setting.column(|row| hat(knot, row))).collect()
}

/// Largest excursion until each row, as a fraction of the largest one of the record.
fn largest_so_far(setting: &SearchSetting, side: Side) -> Vec<f64> {
    let largest_m = setting.largest_position_m().max(f64::MIN_POSITIVE);
    let mut so_far = 0.0_f64;
    let follow = |x: &f64| {
        let excursion = match side {
            Side::Above => *x,
            Side::Below => -x,
            Side::Both => x.abs(),
        };
        so_far = so_far.max(excursion / largest_m);
        so_far
    };
    setting.position_m.iter().map(follow).collect()
}

/// Lowest and highest fitted position, in m.
fn ends_m(setting: &SearchSetting) -> [f64; 2] {
    let positions = || setting.rows.iter().map(|row| setting.position_m[*row]);
    [positions().fold(f64::INFINITY, f64::min), positions().fold(f64::NEG_INFINITY, f64::max)]
}

fn range_m(setting: &SearchSetting) -> f64 {
    let [lowest_m, highest_m] = ends_m(setting);
    (highest_m - lowest_m).max(f64::MIN_POSITIVE)
}

/// Hat functions over the range of the fitted positions.
fn hats_of_position(setting: &SearchSetting, n_knots: usize) -> Vec<Vec<f64>> {
    let [lowest_m, highest_m] = ends_m(setting);
    let spacing_m = range_m(setting) / (n_knots - 1) as f64;
    let place = |row: usize| (setting.position_m[row].clamp(lowest_m, highest_m) - lowest_m) / spacing_m;
    (0..n_knots).map(|knot| setting.column(|row| (1.0 - (place(row) - knot as f64).abs()).max(0.0))).collect()
}

fn force_levels(setting: &SearchSetting) -> Vec<Vec<f64>> {
    let largest_n = setting.acting_force_n.iter().fold(f64::MIN_POSITIVE, |a, b| a.max(b.abs()));
    let mut levels: Vec<f64> = Vec::new();
    for row in &setting.rows {
        let share = setting.acting_force_n[*row] / largest_n;
        if levels.len() <= MOST_LEVELS && levels.iter().all(|level| (level - share).abs() > LEVEL_TOLERANCE) {
            levels.push(share);
        }
    }
    let share = |row: usize| setting.acting_force_n[row] / largest_n;
    if levels.len() > MOST_LEVELS {
        return (1..=4).map(|power| setting.column(|row| share(row).powi(power))).collect();
    }
    let at = |level: f64, row: usize| f64::from(u8::from((share(row) - level).abs() <= LEVEL_TOLERANCE));
    levels.iter().map(|level| setting.column(|row| at(*level, row))).collect()
}

/// Width of the narrowest bell, in sample intervals. Such a bell extends over about five rows.
const NARROWEST: f64 = 1.5;

/// Returns families of shapes with equal numbers of amplitudes. A finding is compared with the best gain of its family by chance.
pub(super) fn families(setting: &SearchSetting) -> Vec<Vec<StructureShape>> {
    let rows = event_rows(setting);
    let rows: Vec<usize> = rows.iter().step_by(1 + rows.len() / MOST_MOMENTS).copied().collect();
    let ramps: Vec<f64> = moments(setting, ramp_spacing_s(setting));
    let mut families = vec![
        vibrations(setting),
        vec![StructureShape::Offset],
        rows.iter().map(|row| StructureShape::Step { row: *row }).collect(),
        ramps.iter().map(|time_s| StructureShape::RampFrom { time_s: *time_s }).collect(),
        ramps.iter().map(|time_s| StructureShape::RampUntil { time_s: *time_s }).collect(),
        rows.iter().map(|row| StructureShape::GainChange { row: *row }).collect(),
        bumps(setting),
        backlashes(setting),
        vec![
            StructureShape::Nonlinearity { power: 2, is_odd: false },
            StructureShape::Nonlinearity { power: 2, is_odd: true },
            StructureShape::Nonlinearity { power: 3, is_odd: true },
        ],
        vec![StructureShape::ForceLevel],
        vec![StructureShape::ForceSquared],
        position_waves(setting),
        [Side::Above, Side::Below, Side::Both].map(|side| StructureShape::Ratchet { side }).to_vec(),
    ];
    families.extend([2, 5, 10].map(|n_harmonics| vec![StructureShape::CycleLocked { n_harmonics }]));
    families.extend([4, 8, 14].map(|n_knots| vec![StructureShape::SinceStep { n_knots }]));
    families.extend([3, 6, 12].map(|n_waves| vec![StructureShape::SlowChange { n_waves }]));
    families.extend([5, 10, 20].map(|n_knots| vec![StructureShape::OfPosition { n_knots }]));
    families
}

/// Returns whether a kind of structure is an event, which occurs once.
pub(super) fn is_event(kind: OutsideKind) -> bool {
    matches!(kind, OutsideKind::Slip | OutsideKind::Ramp | OutsideKind::GainChange | OutsideKind::Disturbance)
}

fn moments(setting: &SearchSetting, spacing_s: f64) -> Vec<f64> {
    let (first_s, last_s) = setting.span_s();
    let n = ((last_s - first_s) / spacing_s).floor() as usize;
    (1..n).map(|k| first_s + k as f64 * spacing_s).collect()
}

/// Vibrations with frequencies from two periods in the record up to the Nyquist frequency, in steps of half the frequency resolution.
fn vibrations(setting: &SearchSetting) -> Vec<StructureShape> {
    let (first_s, last_s) = setting.span_s();
    let length_s = (last_s - first_s).max(f64::MIN_POSITIVE);
    let highest = (length_s / setting.interval_s.max(f64::MIN_POSITIVE)) as usize;
    (4..highest.min(MOST_FREQUENCIES))
        .map(|k| StructureShape::Vibration { frequency_hz: 0.5 * k as f64 / length_s })
        .collect()
}

/// Waves along the position, in steps of half the wavenumber resolution. The longest period is half the range of the fitted positions. The shortest is four standard deviations
/// of the known or estimated noise, because noise blurs shorter waves.
fn position_waves(setting: &SearchSetting) -> Vec<StructureShape> {
    let range_m = range_m(setting);
    let most = 2.0 * range_m / (4.0 * setting.reference_noise_m).max(f64::MIN_POSITIVE);
    (4..(most as usize).min(MOST_FREQUENCIES))
        .map(|k| StructureShape::PositionWave { period_m: 2.0 * range_m / k as f64 })
        .collect()
}

fn bumps(setting: &SearchSetting) -> Vec<StructureShape> {
    let mut list = Vec::new();
    let mut width_s = NARROWEST * setting.interval_s;
    while width_s < 0.5 * setting.cycle_s {
        list.extend(moments(setting, width_s).into_iter().map(|centre_s| StructureShape::Bump { centre_s, width_s }));
        width_s *= 1.7;
    }
    list
}

fn backlashes(setting: &SearchSetting) -> Vec<StructureShape> {
    let largest_m = 0.25 * setting.largest_position_m();
    let smallest_m = 0.25 * setting.reference_noise_m;
    let n = (((largest_m / smallest_m).ln() / 0.4).ceil()).clamp(1.0, 30.0) as i32;
    (0..=n).map(|k| StructureShape::Backlash { half_width_m: smallest_m * (0.4 * f64::from(k)).exp() }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moving(position_um: &[f64]) -> SearchSetting {
        let n_rows = position_um.len();
        SearchSetting {
            time_s: (0..n_rows).map(|row| row as f64).collect(),
            acting_force_n: vec![0.0; n_rows],
            position_m: position_um.iter().map(|x| 1e-6 * x).collect(),
            position_of_squares_m: vec![0.0; n_rows],
            phase: vec![0.0; n_rows],
            since_step: vec![(0.0, 0.0); n_rows],
            rows: (0..n_rows).collect(),
            interval_s: 1.0,
            hold_s: n_rows as f64,
            cycle_s: n_rows as f64,
            reference_noise_m: 1e-6,
        }
    }

    #[test]
    fn a_ratchet_keeps_the_largest_excursion_of_its_side() {
        let setting = moving(&[0.0, 2.0, 1.0, -3.0, 1.0, 4.0]);
        let quarters = |side: Side| -> Vec<f64> {
            let columns = StructureShape::Ratchet { side }.columns_m(&setting);
            columns[0].iter().map(|value| (4.0 * value / UNIT_M).round()).collect()
        };
        assert_eq!(quarters(Side::Above), [0.0, 2.0, 2.0, 2.0, 2.0, 4.0]);
        assert_eq!(quarters(Side::Below), [0.0, 0.0, 0.0, 3.0, 3.0, 3.0]);
        assert_eq!(quarters(Side::Both), [0.0, 2.0, 2.0, 3.0, 3.0, 4.0]);
    }

    /// The hat functions of the position sum to one everywhere. If they are weighted by their knots, their sum is the position.
    #[test]
    fn curves_of_the_position_hold_every_straight_line() {
        let position_um = [-3.0, 0.5, 1.0, 4.0, 2.2, 5.0];
        let columns = StructureShape::OfPosition { n_knots: 5 }.columns_m(&moving(&position_um));
        for (row, x) in position_um.iter().enumerate() {
            let sum: f64 = columns.iter().map(|column| column[row] / UNIT_M).sum();
            let line: f64 =
                columns.iter().enumerate().map(|(k, column)| (-3.0 + 2.0 * k as f64) * column[row] / UNIT_M).sum();
            assert!((sum - 1.0).abs() < 1e-12 && (line - x).abs() < 1e-12, "{sum} {line}");
        }
    }
}
