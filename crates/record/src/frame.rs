//! Where a position is zero and which way it grows (formats §1): from coordinates as they were written to positions along the force.

use std::path::Path;

use super::record::median;
use super::trajectory::Trajectory;
use base::error::{Error, Place, Result};
use base::toml_input::Table;

/// Which position counts as 0.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Zero {
    /// The one that the table has for 0.
    #[default]
    AsWritten,
    /// The first.
    First,
    /// The median of those before the force first acts.
    Rest,
    /// None is known: positions count from the first, and what is left of their offset is fitted.
    Fit,
    /// This one, in the column's unit.
    Value(f64),
}

/// Which way counts as forward.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Direction {
    /// The way in which the numbers grow; of x and y, that of x.
    Forward,
    /// The other.
    Backward,
    /// That of x turned towards y, in degrees.
    Degrees(f64),
    /// The line on which most of the motion lies, to the side to which the force moves it.
    Fit,
}

/// How positions are counted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// Where from.
    pub zero: Zero,
    /// Which way.
    pub direction: Direction,
}

impl Default for Frame {
    fn default() -> Self {
        Self { zero: Zero::AsWritten, direction: Direction::Forward }
    }
}

/// What was done to coordinates so that they became positions along the force.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Settled {
    /// What was subtracted, in m: of x and y where there are both.
    pub zero_m: [f64; 2],
    /// Whether the sign of a single coordinate was turned.
    pub is_reversed: bool,
    /// What x and y became.
    pub projection: Option<Projection>,
}

/// A motion in a plane, seen along one line of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Projection {
    /// Direction of the line, from x towards y, in degrees.
    pub degrees: f64,
    /// Position across the line in m, a row each; `None` where tracking was lost.
    pub across_m: Vec<Option<f64>>,
    /// Root mean square of it about its median, in m.
    pub across_rms_m: f64,
}

/// Passes of the fit of a line that leave out what lies far from it.
const PASSES: usize = 4;
/// Distances from the line, over their median, beyond which a row does not count for it: six standard deviations of normal errors.
const FAR: f64 = 9.0;
/// Share of its size that the work of the force must have for a direction to count as against it.
const CLEARLY: f64 = 0.2;

impl Frame {
    /// What `[measurement]` says of it; `is_plane` where the table has x and y.
    pub fn read(measurement: Table<'_>, is_plane: bool) -> Result<Self> {
        Ok(Self { zero: zero(measurement, is_plane)?, direction: direction(measurement, is_plane)? })
    }

    /// Turns the coordinates of a table into positions; `file` is only named in errors.
    ///
    /// # Errors
    /// [`Error::Input`] where the frame asks for a position that the table does not have.
    pub(super) fn settle(&self, file: &Path, trajectory: &mut Trajectory) -> Result<Settled> {
        let zero_m = self.zero_m(file, trajectory)?;
        let Some(y_m) = trajectory.y_m.take() else {
            trajectory.position_m.iter_mut().flatten().for_each(|x| *x -= zero_m[0]);
            let is_reversed = match self.direction {
                Direction::Backward => true,
                Direction::Fit => is_against(&trajectory.force_n, &trajectory.position_m, 0.0),
                Direction::Forward | Direction::Degrees(_) => false,
            };
            if is_reversed {
                // Not a minus before a zero.
                trajectory.position_m.iter_mut().flatten().for_each(|x| *x = 0.0 - *x);
            }
            return Ok(Settled { zero_m, is_reversed, projection: None });
        };
        let pairs = trajectory.position_m.iter().zip(&y_m);
        let points: Vec<Option<[f64; 2]>> = pairs.map(|(x, y)| Some([(*x)? - zero_m[0], (*y)? - zero_m[1]])).collect();
        let along = |axis: [f64; 2]| -> Vec<Option<f64>> {
            points.iter().map(|point| point.map(|[x, y]| axis[0] * x + axis[1] * y)).collect()
        };
        let axis = match self.direction {
            Direction::Forward => [1.0, 0.0],
            Direction::Backward => [-1.0, 0.0],
            Direction::Degrees(degrees) => [degrees.to_radians().cos(), degrees.to_radians().sin()],
            Direction::Fit => {
                let axis = line_of_motion(&points);
                if is_against(&trajectory.force_n, &along(axis), 0.0) { axis.map(|x| -x) } else { axis }
            }
        };
        trajectory.position_m = along(axis);
        let across_m = along([-axis[1], axis[0]]);
        let middle_m = median(across_m.iter().flatten().copied().collect()).unwrap_or(0.0);
        let squares = across_m.iter().flatten().map(|x| (x - middle_m).powi(2));
        let across_rms_m = (squares.sum::<f64>() / across_m.iter().flatten().count().max(1) as f64).sqrt();
        let degrees = axis[1].atan2(axis[0]).to_degrees();
        let projection = Some(Projection { degrees, across_m, across_rms_m });
        Ok(Settled { zero_m, is_reversed: false, projection })
    }

    fn zero_m(&self, file: &Path, trajectory: &Trajectory) -> Result<[f64; 2]> {
        let refuse = |found: &str, remedy: &str| {
            let place = Place::file(file).at_line(trajectory.lines.first().copied().unwrap_or(1)).at_key("zero");
            Err(Error::input(place, found, remedy))
        };
        let y_m = trajectory.y_m.as_deref();
        match self.zero {
            Zero::AsWritten => Ok([0.0; 2]),
            // Near enough for a prior; what is left is fitted.
            Zero::Fit => {
                let first = trajectory.position_m.iter().position(Option::is_some);
                let at = |rows: &[Option<f64>]| first.and_then(|row| rows[row]).unwrap_or(0.0);
                Ok([at(&trajectory.position_m), y_m.map_or(0.0, at)])
            }
            Zero::Value(value) => Ok([trajectory.position_unit_m * value, 0.0]),
            Zero::First => match trajectory.position_m.first().copied().flatten() {
                Some(first_m) => Ok([first_m, y_m.and_then(|y| y.first().copied().flatten()).unwrap_or(0.0)]),
                None => refuse(
                    "the first row has no position",
                    "write `zero = \"rest\"`, or the position itself where there is one column of it",
                ),
            },
            Zero::Rest => match rest_m(&trajectory.force_n, &trajectory.position_m) {
                Some(x_m) => Ok([x_m, y_m.and_then(|y| rest_m(&trajectory.force_n, y)).unwrap_or(0.0)]),
                None => refuse(
                    "there is no row before the force acts",
                    "write `zero = \"first\"`, or the position itself where there is one column of it",
                ),
            },
        }
    }
}

/// Median position (m) before the force first acts, as written; `None` where it acts from the first row on.
pub(super) fn rest_m(force_n: &[f64], position_m: &[Option<f64>]) -> Option<f64> {
    let n_rest = force_n.iter().take_while(|force| **force == 0.0).count();
    // The first row of a force that rises in a line has moved already.
    median(position_m.iter().take(n_rest).copied().flatten().collect())
}

/// Whether the force's work on the way from row to row is negative, by more than a share of its size.
pub fn is_against(force_n: &[f64], position_m: &[Option<f64>], share: f64) -> bool {
    let moved = position_m.windows(2).zip(force_n).filter_map(|(pair, force)| Some((pair[1]? - pair[0]?, *force)));
    let (work, size) =
        moved.fold((0.0, 0.0), |(work, size), (way, force)| (work + way * force, size + (way * force).abs()));
    work < -share * size && work < 0.0
}

/// Whether positions clearly grow against the force: a passive body takes work up.
pub(super) fn is_clearly_against(force_n: &[f64], position_m: &[Option<f64>]) -> bool {
    is_against(force_n, position_m, CLEARLY)
}

/// Unit vector of the line on which most of a motion lies; rows far from the line do not turn it.
fn line_of_motion(points: &[Option<[f64; 2]>]) -> [f64; 2] {
    let mut kept: Vec<[f64; 2]> = points.iter().flatten().copied().collect();
    let mut axis = [1.0, 0.0];
    for _ in 0..PASSES {
        let n = kept.len().max(1) as f64;
        let mean = [0, 1].map(|k| kept.iter().map(|point| point[k]).sum::<f64>() / n);
        let about = |j: usize, k: usize| kept.iter().map(|p| (p[j] - mean[j]) * (p[k] - mean[k])).sum::<f64>();
        let (xx, xy, yy) = (about(0, 0), about(0, 1), about(1, 1));
        // The axis of larger variance of a symmetric two-by-two matrix.
        let angle = 0.5 * (2.0 * xy).atan2(xx - yy);
        axis = [angle.cos(), angle.sin()];
        let distance = |p: &[f64; 2]| (axis[0] * (p[1] - mean[1]) - axis[1] * (p[0] - mean[0])).abs();
        let Some(middle) = median(kept.iter().map(distance).collect()).filter(|middle| *middle > 0.0) else { break };
        let near: Vec<[f64; 2]> = kept.iter().filter(|p| distance(p) <= FAR * middle).copied().collect();
        if near.len() == kept.len() {
            break;
        }
        kept = near;
    }
    axis
}

fn zero(measurement: Table<'_>, is_plane: bool) -> Result<Zero> {
    if !measurement.has("zero") {
        return Ok(Zero::AsWritten);
    }
    if measurement.is_number("zero") {
        if is_plane {
            let remedy = "write \"first\", \"rest\" (the positions before the force acts) or \"fit\"";
            return Err(measurement.refuse("zero", "one number cannot be the zero of x and y", remedy));
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
            "write \"first\", \"rest\" (the positions before the force acts), \"fit\" or the position itself",
        )),
    }
}

/// Degrees that a direction may have.
const DEGREES: std::ops::RangeInclusive<f64> = -360.0..=360.0;

fn direction(measurement: Table<'_>, is_plane: bool) -> Result<Direction> {
    let remedy = if is_plane {
        "write \"fit\", or the direction of the motion in degrees from x towards y"
    } else {
        "write \"+\", \"-\" or \"fit\"; degrees are for tables with `position_x` and `position_y`"
    };
    if !measurement.has("direction") {
        return Ok(if is_plane { Direction::Fit } else { Direction::Forward });
    }
    if measurement.is_number("direction") {
        let degrees = measurement.number("direction")?.unwrap_or(0.0);
        if is_plane && DEGREES.contains(&degrees) {
            return Ok(Direction::Degrees(degrees));
        }
        return Err(measurement.refuse("direction", format!("{degrees} is no direction of these positions"), remedy));
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

    /// A pull along 30°, against the numbers, of a bead that starts at (2500, 800) µm and wobbles across by 0.5 µm; one row in twenty is an outlier sideways.
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
        trajectory.y_m = Some(y_m);
        (trajectory, truth)
    }

    #[test]
    fn a_plane_motion_becomes_one_along_the_force_and_what_is_across_is_kept() {
        let (mut trajectory, truth) = plane();
        let frame = Frame { zero: Zero::Rest, direction: Direction::Fit };
        let settled = frame.settle(Path::new("t.csv"), &mut trajectory).unwrap();
        let projection = settled.projection.unwrap();
        assert!((projection.degrees + 150.0).abs() < 0.1, "{}", projection.degrees);
        assert_eq!(trajectory.position_m[50], None);
        for (i, (found, truth)) in trajectory.position_m.iter().zip(&truth).enumerate() {
            // The outliers lie across; the tilt of the fitted line, below 0.1°, brings a 570th of them into the position.
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
        let settled = frame.settle(Path::new("t.csv"), &mut trajectory).unwrap();
        assert!((trajectory.position_m[399].unwrap() - truth[399]).abs() < 1e-9);
        assert!((settled.projection.unwrap().degrees + 150.0).abs() < 1e-9);
    }

    #[test]
    fn a_single_coordinate_turns_to_the_force() {
        let (mut trajectory, truth) = plane();
        trajectory.y_m = None;
        trajectory.position_m = truth.iter().map(|x| Some(7e-6 - x)).collect();
        let frame = Frame { zero: Zero::Rest, direction: Direction::Fit };
        assert!(frame.settle(Path::new("t.csv"), &mut trajectory).unwrap().is_reversed);
        assert!((trajectory.position_m[399].unwrap() - truth[399]).abs() < 1e-12);
    }
}
