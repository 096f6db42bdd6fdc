//! Zero and direction of positions (formats §1), and the conversion of coordinates in the table to positions along the force.

use std::f64::consts::SQRT_2;
use std::path::Path;

use super::control::correlation_of_changes;
use super::force::Force;
use super::robust::{SD_PER_MAD, median};
use super::trajectory::Trajectory;
use base::error::{Error, InputPlace, Result};
use base::toml_input::TomlTable;

/// Rule for the position that counts as 0.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Zero {
    /// Zero of the table: positions are used as written.
    #[default]
    AsWritten,
    /// The first position counts as 0.
    First,
    /// The median position before the force first acts counts as 0.
    Rest,
    /// The zero is unknown: positions count from the first position, and the remaining offset is fitted.
    Fit,
    /// The given position, in the column's unit, counts as 0.
    Value(f64),
}

/// Rule for the direction in which positions count as positive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Direction {
    /// Direction in which the numbers in the table grow; for several coordinates, the direction of x.
    Forward,
    /// Direction in which the numbers in the table fall; for several coordinates, the opposite of x.
    Backward,
    /// Direction at the given angle in degrees, measured from x towards y.
    Degrees(f64),
    /// Line along which the bead moves most, with the sign of the motion that the force causes.
    Fit,
}

/// Smallest ratio of the noise to the smallest difference of positions at which a position of exactly 0 is no coincidence.
const DIGITS: f64 = 50.0;

/// True if positions were probably measured from the first row's position, whose noise then shifts all positions: only the first position is exactly 0, although the
/// noise (m) is many times the resolution of the positions.
pub fn is_zeroed_by_first_row(position_m: &[Option<f64>], noise_m: f64) -> bool {
    let mut positions: Vec<f64> = position_m.iter().flatten().copied().collect();
    if positions.first() != Some(&0.0) || positions.iter().filter(|x| **x == 0.0).count() > 1 {
        return false;
    }
    positions.sort_unstable_by(f64::total_cmp);
    let steps = positions.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0);
    steps.fold(f64::INFINITY, f64::min) <= noise_m / DIGITS
}

/// Least number of rows before the command first changes that show an offset of the measured quantity.
const ROWS_AT_REST: usize = 5;
/// Least such offset, in standard deviations of the noise at rest, and divided by the range of the measured quantity.
const OFFSET_NOISES: f64 = 6.0;
const OFFSET_SHARE: f64 = 0.02;
/// Largest change of a command at rest, divided by its range, as a measured strain has it.
const COMMAND_AT_REST: f64 = 0.002;

/// Offset of a measured quantity, from the rows at a command of 0 before it first changes; `None` without such rows, and for an offset that is not clear.
pub fn offset_at_rest(command: &[f64], measured: &[Option<f64>]) -> Option<f64> {
    let (low, high) =
        command.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(*x), high.max(*x)));
    // A measured strain is noisy at rest.
    let steps = command.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
    let noise = SD_PER_MAD * median(steps)? / SQRT_2;
    let tolerance = (COMMAND_AT_REST * (high - low)).max(OFFSET_NOISES * noise);
    let n_rest = command.iter().take_while(|value| (**value - command[0]).abs() <= tolerance).count();
    let at_rest: Vec<f64> = measured[..n_rest].iter().flatten().copied().collect();
    // Without a change of the command there is no rest before it.
    if n_rest == command.len() || at_rest.len() < ROWS_AT_REST || command[0].abs() > tolerance {
        return None;
    }
    let offset = median(at_rest.clone())?;
    let noise = SD_PER_MAD * median(at_rest.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect())? / SQRT_2;
    let (low, high) = measured.iter().flatten().fold((0.0_f64, 0.0_f64), |(low, high), x| (low.min(*x), high.max(*x)));
    (offset.abs() > (OFFSET_NOISES * noise).max(OFFSET_SHARE * (high - low))).then_some(offset)
}

/// Rules for the zero and the direction of positions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// Rule for the position that counts as 0.
    pub zero: Zero,
    /// Rule for the direction in which positions count as positive.
    pub direction: Direction,
}

impl Default for Frame {
    fn default() -> Self {
        Self { zero: Zero::AsWritten, direction: Direction::Forward }
    }
}

/// Conversion that was applied to the coordinates to get positions along the force.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct AppliedFrame {
    /// Position that was subtracted from each coordinate, in m.
    pub zero_m: Vec<f64>,
    /// True if the sign of a single coordinate was reversed.
    pub is_reversed: bool,
    /// Projection of several coordinates onto a line; `None` for a single coordinate.
    pub projection: Option<Projection>,
}

/// Projection of a motion in two or three dimensions onto a line.
#[derive(Debug, Clone, PartialEq)]
pub struct Projection {
    /// Unit vector of the line, with one component for each coordinate.
    pub axis: Vec<f64>,
    /// Position across the line in m, for each row; `None` if tracking was lost. In three dimensions, it is the position along the direction of
    /// largest motion across the line.
    pub across_m: Vec<Option<f64>>,
    /// Root mean square motion across the line about its median, in m.
    pub across_rms_m: f64,
}

impl std::fmt::Display for Projection {
    /// Writes the coordinates and the direction of their line, such as `x and y on a line at 45.0° from x`.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.axis.as_slice() {
            [x, y] => write!(f, "x and y on a line at {:.1}° from x", y.atan2(*x).to_degrees()),
            axis => {
                let components: Vec<String> = axis.iter().map(|part| format!("{part:.3}")).collect();
                write!(f, "x, y and z on the line ({})", components.join(", "))
            }
        }
    }
}

/// Number of passes of the fit of a line of motion. Each pass excludes the rows far from the line of the previous pass.
const PASSES: usize = 4;
/// Multiple of the median distance from the line of motion above which the fit excludes a row. For normal errors, it is six standard deviations.
const FAR: f64 = 9.0;
/// Number of squarings of a covariance matrix. They raise its eigenvalues to the power 2⁴⁰, which separates all but nearly equal eigenvalues.
const SQUARINGS: usize = 40;
/// Largest shift between positions and force that is tried, in rows.
const MOST_LAGS: usize = 200;
/// Fraction of the summed absolute work that the negative work must exceed for a motion against the force.
const CLEARLY: f64 = 0.2;

impl Frame {
    /// Reads the keys `zero` and `direction` from `[measurement]`. `n_axes` is the number of coordinates in the table.
    pub fn read(measurement: TomlTable<'_>, n_axes: usize) -> Result<Self> {
        Ok(Self { zero: zero(measurement, n_axes)?, direction: direction(measurement, n_axes)? })
    }

    /// Converts a trajectory's coordinates to positions along the force, in place, and returns the applied conversion. Errors name `file`.
    ///
    /// # Errors
    /// [`Error::Input`] if the frame needs a position that the table lacks.
    pub(super) fn apply(&self, file: &Path, trajectory: &mut Trajectory) -> Result<AppliedFrame> {
        let zero_m = self.zero_m(file, trajectory)?;
        if trajectory.others_m.is_empty() {
            trajectory.position_m.iter_mut().flatten().for_each(|x| *x -= zero_m[0]);
            let is_reversed = match self.direction {
                Direction::Backward => true,
                Direction::Fit => is_work_negative(&trajectory.force_n, &trajectory.position_m, 0.0),
                Direction::Forward | Direction::Degrees(_) => false,
            };
            if is_reversed {
                // Subtraction from 0 avoids a negative zero.
                trajectory.position_m.iter_mut().flatten().for_each(|x| *x = 0.0 - *x);
            }
            return Ok(AppliedFrame { zero_m, is_reversed, projection: None });
        }
        let others_m = std::mem::take(&mut trajectory.others_m);
        let n_axes = 1 + others_m.len();
        let points: Vec<Option<SpacePoint>> = (0..trajectory.position_m.len())
            .map(|row| {
                let others = others_m.iter().map(|coordinate| coordinate[row]);
                let mut point = SpacePoint::default();
                for (k, coordinate) in std::iter::once(trajectory.position_m[row]).chain(others).enumerate() {
                    point[k] = coordinate? - zero_m[k];
                }
                Some(point)
            })
            .collect();
        let along =
            |axis: SpacePoint| -> Vec<Option<f64>> { points.iter().map(|point| Some(dot(axis, (*point)?))).collect() };
        let axis = match self.direction {
            Direction::Forward => [1.0, 0.0, 0.0],
            Direction::Backward => [-1.0, 0.0, 0.0],
            Direction::Degrees(degrees) => [degrees.to_radians().cos(), degrees.to_radians().sin(), 0.0],
            Direction::Fit => {
                let axis = line_of_force(&trajectory.time_s, &trajectory.force_n, &points);
                if is_work_negative(&trajectory.force_n, &along(axis), 0.0) { axis.map(|x| -x) } else { axis }
            }
        };
        trajectory.position_m = along(axis);
        let off_line = |point: SpacePoint| without(point, axis);
        let first_across = match n_axes {
            2 => [-axis[1], axis[0], 0.0],
            _ => normal(line_of_motion(&points.iter().map(|point| point.map(off_line)).collect::<Vec<_>>()), axis),
        };
        let across_m = along(first_across);
        // Direction normal to the line and to `first_across`, which exists only for three coordinates.
        let last_across = [
            axis[1] * first_across[2] - axis[2] * first_across[1],
            axis[2] * first_across[0] - axis[0] * first_across[2],
            axis[0] * first_across[1] - axis[1] * first_across[0],
        ];
        let square_m2 = |across_m: &[Option<f64>]| {
            let middle_m = median(across_m.iter().flatten().copied().collect()).unwrap_or(0.0);
            let squares = across_m.iter().flatten().map(|x| (x - middle_m).powi(2));
            squares.sum::<f64>() / across_m.iter().flatten().count().max(1) as f64
        };
        let mut rms_m2 = square_m2(&across_m);
        if n_axes > 2 {
            rms_m2 += square_m2(&along(last_across));
        }
        let projection = Projection { axis: axis[..n_axes].to_vec(), across_m, across_rms_m: rms_m2.sqrt() };
        Ok(AppliedFrame { zero_m, is_reversed: false, projection: Some(projection) })
    }

    fn zero_m(&self, file: &Path, trajectory: &Trajectory) -> Result<Vec<f64>> {
        let refuse = |found: &str, remedy: &str| {
            let place = InputPlace::file(file).at_line(trajectory.lines.first().copied().unwrap_or(1)).at_key("zero");
            Err(Error::input(place, found, remedy))
        };
        let coordinates = || std::iter::once(&trajectory.position_m).chain(&trajectory.others_m);
        let at_row = |row: usize| coordinates().map(|positions| positions[row].unwrap_or(0.0)).collect::<Vec<f64>>();
        match self.zero {
            Zero::AsWritten => Ok(vec![0.0; coordinates().count()]),
            // The first position only serves as the centre of a prior, because the remaining offset is fitted.
            Zero::Fit => Ok(at_row(trajectory.position_m.iter().position(Option::is_some).unwrap_or(0))),
            Zero::Value(value) => Ok(vec![trajectory.position_unit_m * value]),
            Zero::First if trajectory.position_m.first().copied().flatten().is_some() => Ok(at_row(0)),
            Zero::First => refuse(
                "the first row has no position",
                "write `zero = \"rest\"`, or with a single position column the position that counts as 0, such as `zero = 12.5`",
            ),
            Zero::Rest => match rest_m(&trajectory.force_n, &trajectory.position_m) {
                Some(_) => {
                    Ok(coordinates().map(|positions| rest_m(&trajectory.force_n, positions).unwrap_or(0.0)).collect())
                }
                None => refuse(
                    "no row with a position precedes the force",
                    "write `zero = \"first\"`, or with a single position column the position that counts as 0, such as `zero = 12.5`",
                ),
            },
        }
    }
}

/// Coordinates x, y and z of a row; coordinates that the table lacks are 0.
type SpacePoint = [f64; 3];

fn dot(a: SpacePoint, b: SpacePoint) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Component of the vector `point` that is normal to the unit vector `axis`.
fn without(point: SpacePoint, axis: SpacePoint) -> SpacePoint {
    let along = dot(point, axis);
    [0, 1, 2].map(|k| point[k] - along * axis[k])
}

/// Returns the median position (m) before the force first acts, in the table's coordinates; `None` if no row with a position precedes the force.
pub(super) fn rest_m(force_n: &[f64], position_m: &[Option<f64>]) -> Option<f64> {
    let n_rest = force_n.iter().take_while(|force| **force == 0.0).count();
    // The first row with a force does not count, because the bead has already moved there if the force rises linearly.
    median(position_m.iter().take(n_rest).copied().flatten().collect())
}

/// Sums the work of the force from row to row, without rows whose measured force was lost (NaN). Returns the sum with signs and the sum of absolute values.
fn work_and_size(force_n: &[f64], position_m: &[Option<f64>]) -> (f64, f64) {
    let known = position_m.windows(2).zip(force_n).filter(|(_, force)| !force.is_nan());
    let moved = known.filter_map(|(pair, force)| Some((pair[1]? - pair[0]?, *force)));
    moved.fold((0.0, 0.0), |(work, size), (way, force)| (work + way * force, size + (way * force).abs()))
}

/// True if the summed work of the force is negative and its absolute value exceeds the fraction `share` of the sum of absolute values.
pub fn is_work_negative(force_n: &[f64], position_m: &[Option<f64>], share: f64) -> bool {
    let (work, size) = work_and_size(force_n, position_m);
    work < -share * size && work < 0.0
}

/// Correlation of the changes of force and position below which the position grows against the force.
const AGAINST: f64 = -0.5;

/// Sum of absolute works, as a fraction of a large force times the whole way, up to which it shows no sign: a commanded position may jump while the measured force is noise about 0.
const NEGLIGIBLE: f64 = 0.02;

/// True if positions clearly grow against the force, which is impossible for a passive body. Each step of the position is paired with the force some
/// rows later, by the shift with the largest absolute work. Without a shift, the work does not show the sign of the motion if force and positions are
/// not synchronous.
pub(super) fn moves_against_force(force_n: &[f64], position_m: &[Option<f64>]) -> bool {
    let steps = Force::from(force_n).step_rows();
    let shortest = steps.windows(2).map(|pair| pair[1] - pair[0]).min().unwrap_or(0);
    let mut sizes_n: Vec<f64> = force_n.iter().map(|force| force.abs()).collect();
    sizes_n.sort_by(f64::total_cmp);
    // One wrong row does not count.
    let large_n = sizes_n.get(sizes_n.len() * 9 / 10).copied().unwrap_or(0.0);
    let way_m: f64 = position_m.windows(2).filter_map(|pair| Some((pair[1]? - pair[0]?).abs())).sum();
    let most = large_n * way_m;
    let share = |lag: usize| {
        let (work, size) = work_and_size(&force_n[lag.min(force_n.len())..], position_m);
        if size > NEGLIGIBLE * most { work / size } else { 0.0 }
    };
    let lags = 0..=(shortest / 2).min(MOST_LAGS).min(force_n.len() / 4);
    let best = lags.map(share).max_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap_or(0.0);
    // The noise of a long hold adds to the sum of absolute values, so that the work then shows nothing.
    best < -CLEARLY || best < CLEARLY && correlation_of_changes(force_n, position_m) < AGAINST
}

/// Returns the unit vector normal to `axis` that is nearest to `direction`. If `direction` lies along the axis, any normal unit vector is returned.
fn normal(direction: SpacePoint, axis: SpacePoint) -> SpacePoint {
    let smallest = (0..3).min_by(|a, b| axis[*a].abs().total_cmp(&axis[*b].abs())).unwrap_or(0);
    let across = without(direction, axis);
    let across = if dot(across, across) > 0.25 {
        across
    } else {
        without([0, 1, 2].map(|k| f64::from(u8::from(k == smallest))), axis)
    };
    let length = dot(across, across).sqrt();
    across.map(|x| x / length)
}

/// Least difference between two directions, in standard errors, that shows a drift.
const DRIFT_ERRORS: f64 = 5.0;
/// Least square of the motion that follows the force, as a multiple of that of the noise in as many numbers.
const SHOWN: f64 = 50.0;
/// Least part of the squares of a regressor that the regressors before it leave.
const OWN_PART: f64 = 1e-6;

/// Returns the unit vector of the line on which a force moves a body. A steady drift in another direction turns the line of the largest motion. The part of the motion that
/// follows the force and its integral, and no straight line in time, has the direction of the force whatever the law: across it are only drift and noise.
fn line_of_force(time_s: &[f64], force_n: &[f64], points: &[Option<SpacePoint>]) -> SpacePoint {
    let largest = line_of_motion(points);
    let size = |point: SpacePoint| dot(point, point).sqrt();
    // Impulse of the force up to each row.
    let impulses = std::iter::once(0.0).chain(time_s.windows(2).zip(force_n).scan(0.0, |sum, (pair, force)| {
        *sum += (pair[1] - pair[0]) * force;
        Some(*sum)
    }));
    let rows: Vec<([f64; 4], SpacePoint)> = time_s
        .iter()
        .zip(force_n)
        .zip(impulses)
        .zip(points)
        .filter_map(|(((time, force), impulse), point)| Some(([1.0, time - time_s[0], *force, impulse], (*point)?)))
        .filter(|(of_row, _)| of_row.iter().all(|value| value.is_finite()))
        .collect();
    let Some(middle) = median(rows.iter().map(|(_, point)| size(without(*point, largest))).collect()) else {
        return largest;
    };
    let rows: Vec<_> = rows.into_iter().filter(|(_, point)| size(without(*point, largest)) <= FAR * middle).collect();
    // Each regressor without its parts along those before it, and the part of the points along it.
    let (mut columns, mut left): (Vec<Vec<f64>>, Vec<SpacePoint>) =
        (Vec::new(), rows.iter().map(|row| row.1).collect());
    let mut covariance = [[0.0; 3]; 3];
    for k in 0..4 {
        let mut column: Vec<f64> = rows.iter().map(|row| row.0[k]).collect();
        let whole: f64 = column.iter().map(|x| x * x).sum();
        for other in &columns {
            let part: f64 = column.iter().zip(other).map(|(a, b)| a * b).sum();
            column.iter_mut().zip(other).for_each(|(a, b)| *a -= part * b);
        }
        let own = column.iter().map(|x| x * x).sum::<f64>();
        if own <= OWN_PART * whole {
            continue;
        }
        column.iter_mut().for_each(|x| *x /= own.sqrt());
        let part = [0, 1, 2].map(|axis| column.iter().zip(&left).map(|(x, point)| x * point[axis]).sum::<f64>());
        left.iter_mut().zip(&column).for_each(|(point, x)| (0..3).for_each(|axis| point[axis] -= x * part[axis]));
        if k > 1 {
            (0..3).for_each(|i| (0..3).for_each(|j| covariance[i][j] += part[i] * part[j]));
        }
        columns.push(column);
    }
    let Some(axis) = largest_direction(covariance) else { return largest };
    let square_m2 = (0..3).flat_map(|i| (0..3).map(move |j| axis[i] * covariance[i][j] * axis[j])).sum::<f64>();
    let noise_m = SD_PER_MAD * median(left.iter().map(|point| size(without(*point, axis))).collect()).unwrap_or(0.0);
    let turned = size(without(largest, axis));
    let is_turned = square_m2 > SHOWN * noise_m.powi(2) && turned > DRIFT_ERRORS * noise_m / square_m2.sqrt();
    if is_turned { axis } else { largest }
}

/// Returns the unit vector of the line along which a motion is largest. Rows far from the line have no influence.
fn line_of_motion(points: &[Option<SpacePoint>]) -> SpacePoint {
    let mut kept: Vec<SpacePoint> = points.iter().flatten().copied().collect();
    let mut axis = [1.0, 0.0, 0.0];
    for _ in 0..PASSES {
        let n = kept.len().max(1) as f64;
        let mean = [0, 1, 2].map(|k| kept.iter().map(|point| point[k]).sum::<f64>() / n);
        let about = |point: &SpacePoint| [0, 1, 2].map(|k| point[k] - mean[k]);
        let mut covariance = [[0.0; 3]; 3];
        for point in kept.iter().map(about) {
            for j in 0..3 {
                (0..3).for_each(|k| covariance[j][k] += point[j] * point[k]);
            }
        }
        axis = largest_direction(covariance).unwrap_or(axis);
        let distance = |point: &SpacePoint| {
            let off = without(about(point), axis);
            dot(off, off).sqrt()
        };
        let Some(middle) = median(kept.iter().map(distance).collect()).filter(|middle| *middle > 0.0) else { break };
        let near: Vec<SpacePoint> = kept.iter().filter(|point| distance(point) <= FAR * middle).copied().collect();
        if near.len() == kept.len() {
            break;
        }
        kept = near;
    }
    axis
}

/// Returns the unit eigenvector of a symmetric matrix for the largest eigenvalue, by repeated squaring; `None` for a zero matrix.
fn largest_direction(matrix: [[f64; 3]; 3]) -> Option<SpacePoint> {
    let mut power = matrix;
    for _ in 0..SQUARINGS {
        let trace = power[0][0] + power[1][1] + power[2][2];
        if trace <= 0.0 {
            return None;
        }
        let scaled = power.map(|row| row.map(|x| x / trace));
        power = [0, 1, 2].map(|j| [0, 1, 2].map(|k| (0..3).map(|m| scaled[j][m] * scaled[m][k]).sum()));
    }
    // All columns of the power are now parallel to the eigenvector. The longest column has the smallest rounding error.
    let column = (0..3).max_by(|a, b| power[*a][*a].total_cmp(&power[*b][*b]))?;
    let direction = [0, 1, 2].map(|k| power[k][column]);
    let length = dot(direction, direction).sqrt();
    (length > 0.0).then(|| direction.map(|x| x / length))
}

fn zero(measurement: TomlTable<'_>, n_axes: usize) -> Result<Zero> {
    if !measurement.has("zero") {
        return Ok(Zero::AsWritten);
    }
    if measurement.is_number("zero") {
        if n_axes > 1 {
            let remedy = "write \"first\", \"rest\" (the positions before the force acts) or \"fit\"";
            return Err(measurement.refuse("zero", "one number cannot define the zero of several coordinates", remedy));
        }
        return Ok(measurement.number("zero")?.map_or(Zero::AsWritten, Zero::Value));
    }
    match measurement.required_text("zero", "zero = \"first\"")?.as_str() {
        "first" => Ok(Zero::First),
        "rest" => Ok(Zero::Rest),
        "fit" => Ok(Zero::Fit),
        other => Err(measurement.refuse(
            "zero",
            format!("unknown zero `{other}`"),
            "write \"first\", \"rest\" (the positions before the force acts), \"fit\" or the position that counts as 0",
        )),
    }
}

/// Allowed angles of a direction, in degrees.
const DEGREES: std::ops::RangeInclusive<f64> = -360.0..=360.0;

fn direction(measurement: TomlTable<'_>, n_axes: usize) -> Result<Direction> {
    let remedy = match n_axes {
        1 => "write \"+\", \"-\" or \"fit\"; degrees are for tables with `position_x` and `position_y`",
        2 => "write \"fit\", or the direction of the motion in degrees from x towards y",
        _ => "write \"fit\"; an angle from x towards y defines no direction in space",
    };
    if !measurement.has("direction") {
        return Ok(if n_axes > 1 { Direction::Fit } else { Direction::Forward });
    }
    if measurement.is_number("direction") {
        let degrees = measurement.number("direction")?.unwrap_or(0.0);
        if n_axes == 2 && DEGREES.contains(&degrees) {
            return Ok(Direction::Degrees(degrees));
        }
        return Err(measurement.refuse(
            "direction",
            format!("{degrees} is not a direction for these positions"),
            remedy,
        ));
    }
    match measurement.required_text("direction", "direction = \"-\"")?.as_str() {
        "+" => Ok(Direction::Forward),
        "-" => Ok(Direction::Backward),
        "fit" => Ok(Direction::Fit),
        other => Err(measurement.refuse("direction", format!("unknown direction `{other}`"), remedy)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A first position of exactly 0 is no coincidence beside noise of many digits. Positions that are rounded to the noise are often 0.
    #[test]
    fn a_first_row_that_was_subtracted_is_recognised() {
        // Hundredths of a micrometre, none of which is 0 but the first.
        let fine: Vec<Option<f64>> = (0..400).map(|row| Some(1e-8 * f64::from(37 * row % 997))).collect();
        assert!(is_zeroed_by_first_row(&fine, 3e-6));
        assert!(!is_zeroed_by_first_row(&fine[1..], 3e-6));
        let coarse: Vec<Option<f64>> = [0.0, 10e-6, 0.0, 10e-6].map(Some).to_vec();
        assert!(!is_zeroed_by_first_row(&coarse, 3e-6));
        assert!(!is_zeroed_by_first_row(&fine, 1e-9), "without noise the zero is exact");
    }

    /// Returns the trajectory of a pull along a line at 30° towards falling coordinates, and the true positions along this line. The bead starts at
    /// (2500, 800) µm and oscillates across the pull by 0.5 µm. One row in twenty is an outlier across the pull.
    fn plane() -> (Trajectory, Vec<f64>) {
        let mut trajectory = Trajectory::empty(false, "F", "x");
        let (mut truth, mut y_m) = (Vec::new(), Vec::new());
        let (sin, cos) = 30.0_f64.to_radians().sin_cos();
        for i in 0..400 {
            let (t, outlier) = (f64::from(i), if i % 20 == 7 { 300e-6 } else { 0.0 });
            let along = if i < 4 { 0.0 } else { 2e-6 * (t - 3.0) };
            let across = 0.5e-6 * if i % 2 == 0 { 1.0 } else { -1.0 } + outlier;
            trajectory.time_s.push(t);
            trajectory.force_n.push(if i < 3 { 0.0 } else { 1e-6 });
            trajectory.lines.push(i as usize + 2);
            trajectory.position_m.push((i != 50).then_some(2500e-6 - cos * along - sin * across));
            y_m.push(Some(800e-6 - sin * along + cos * across));
            truth.push(along);
        }
        trajectory.others_m = vec![y_m];
        (trajectory, truth)
    }

    /// A drift across the force turns the line of the largest motion by 13°, and the line of the force by nothing but noise: 0.02 µm on 3 µm.
    #[test]
    fn a_drift_does_not_turn_the_line_of_the_force() {
        let noise = |row: usize, k: f64| 0.04e-6 * ((row as f64 * k).fract() - 0.5);
        let rows = 0..300_usize;
        let time_s: Vec<f64> = rows.clone().map(|row| 0.2 * row as f64).collect();
        let force_n: Vec<f64> = rows.clone().map(|row| if (25..125).contains(&row) { 1e-8 } else { 0.0 }).collect();
        let creep =
            |since_s: f64| if since_s > 0.0 { 1.5 * (1.0 - (-since_s / 2.0).exp()) + 0.05 * since_s } else { 0.0 };
        let points: Vec<Option<SpacePoint>> = rows
            .map(|row| {
                let along = 1e-6 * (creep(time_s[row] - 5.0) - creep(time_s[row] - 25.0));
                let drift = 0.03e-6 * time_s[row];
                Some([along + noise(row, 0.754_877_67), drift + noise(row, 0.569_840_29), 0.0])
            })
            .collect();
        let degrees = |axis: SpacePoint| (axis[1] / axis[0]).atan().to_degrees();
        assert!(degrees(line_of_motion(&points)) < -10.0);
        assert!(degrees(line_of_force(&time_s, &force_n, &points)).abs() < 0.2);
        // Without a force that changes, the line of the largest motion remains.
        let none = line_of_force(&time_s, &[1e-8; 300], &points);
        assert_eq!(none, line_of_motion(&points));
    }

    fn degrees(projection: &Projection) -> f64 {
        projection.axis[1].atan2(projection.axis[0]).to_degrees()
    }

    /// Checks the line of a pull along (2, −1, 2)/3. The bead also oscillates by 0.5 µm along (1, 2, 0)/√5 and by 0.2 µm along (4, −2, −5)/√45. All
    /// three directions are normal to each other.
    #[test]
    fn a_motion_in_space_becomes_one_along_the_force() {
        let mut trajectory = Trajectory::empty(false, "F", "x");
        trajectory.others_m = vec![Vec::new(), Vec::new()];
        let (line, across) = ([2.0 / 3.0, -1.0 / 3.0, 2.0 / 3.0], [1.0, 2.0, 0.0].map(|x: f64| x / 5.0_f64.sqrt()));
        let third = [4.0, -2.0, -5.0].map(|x: f64| x / 45.0_f64.sqrt());
        let truth: Vec<f64> = (0..200).map(|row| 3e-6 * f64::from(row)).collect();
        for (row, along) in truth.iter().enumerate() {
            let wobble = if row % 2 == 0 { 0.5e-6 } else { -0.5e-6 };
            let slower = if row / 2 % 2 == 0 { 0.2e-6 } else { -0.2e-6 };
            let at = |k: usize| Some(1e-3 + along * line[k] + wobble * across[k] + slower * third[k]);
            trajectory.time_s.push(row as f64);
            trajectory.force_n.push(1e-6);
            trajectory.lines.push(row + 2);
            trajectory.position_m.push(at(0));
            (0..2).for_each(|k| trajectory.others_m[k].push(at(k + 1)));
        }
        let frame = Frame { zero: Zero::First, direction: Direction::Fit };
        let projection = frame.apply(Path::new("t.csv"), &mut trajectory).unwrap().projection.unwrap();
        assert!(projection.axis.iter().zip(line).all(|(found, line)| (found - line).abs() < 1e-3), "{projection}");
        let rms_m = (0.5_f64.powi(2) + 0.2_f64.powi(2)).sqrt() * 1e-6;
        assert!((projection.across_rms_m - rms_m).abs() < 2e-9, "{}", projection.across_rms_m);
        for (found, truth) in trajectory.position_m.iter().zip(&truth) {
            assert!(found.is_some_and(|found| (found - truth).abs() < 1e-8), "{found:?} {truth}");
        }
    }

    #[test]
    fn a_plane_motion_becomes_one_along_the_force_and_what_is_across_is_kept() {
        let (mut trajectory, truth) = plane();
        let frame = Frame { zero: Zero::Rest, direction: Direction::Fit };
        let settled = frame.apply(Path::new("t.csv"), &mut trajectory).unwrap();
        let projection = settled.projection.unwrap();
        assert!((degrees(&projection) + 150.0).abs() < 0.1, "{projection}");
        assert_eq!(trajectory.position_m[50], None);
        for (i, (found, truth)) in trajectory.position_m.iter().zip(&truth).enumerate() {
            // The outliers lie across the line. The fitted line is tilted by less than 0.1°, so 1/570 of each outlier adds to the position.
            assert!(found.is_none_or(|found| (found - truth).abs() < 0.6e-6), "{i}: {found:?} {truth}");
        }
        let rms_um = 1e6 * projection.across_rms_m;
        let expected_um = (300.0_f64.powi(2) / 20.0).sqrt();
        assert!((rms_um - expected_um).abs() < 0.05 * expected_um, "{rms_um}");
        assert!((settled.zero_m[0] - 2500e-6).abs() < 1e-6 && (settled.zero_m[1] - 800e-6).abs() < 1e-6);
    }

    #[test]
    fn a_stated_direction_is_taken() {
        let (mut trajectory, truth) = plane();
        let frame = Frame { zero: Zero::First, direction: Direction::Degrees(-150.0) };
        let settled = frame.apply(Path::new("t.csv"), &mut trajectory).unwrap();
        assert!((trajectory.position_m[399].unwrap() - truth[399]).abs() < 1e-9);
        assert!((degrees(&settled.projection.unwrap()) + 150.0).abs() < 1e-9);
    }

    #[test]
    fn a_single_coordinate_turns_to_the_force() {
        let (mut trajectory, truth) = plane();
        trajectory.others_m.clear();
        trajectory.position_m = truth.iter().map(|x| Some(7e-6 - x)).collect();
        let frame = Frame { zero: Zero::Rest, direction: Direction::Fit };
        assert!(frame.apply(Path::new("t.csv"), &mut trajectory).unwrap().is_reversed);
        assert!((trajectory.position_m[399].unwrap() - truth[399]).abs() < 1e-12);
    }
}
