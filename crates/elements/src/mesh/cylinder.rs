//! Built-in mesh of the gel between a circular cylinder and the outer sphere, graded towards the
//! cylinder's sharp rim.
//!
//! In a section through the axis, lines run from the end cap and from the mantle to the outer
//! surface. They fan out at the rim. Sheets surround the body. Near it, they are cylinders at a
//! constant distance, with a sharp rim. Farther out, they become spheres.
//!
//! The stress is singular at the rim. The displacement varies with the distance from the rim to the
//! power 0.54 at a Poisson's ratio of 0.5 (0.6 at 0.3). Elements of equal size would have errors of
//! several per cent. The elements therefore shrink towards the rim along the cap, along the mantle
//! and across the sheets. Node positions follow the power [`GRADING`] of the element number.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};
use std::ops::RangeInclusive;

use super::Mesh;
use super::box_surface::{BoxSurface, layers_per_level, long_axis};
use super::spheroid::check_aspect;
use base::error::{Error, Result, Setting};
use record::Orientation;

/// Exponent of the grading: an element's position varies with its number to this power. The energy
/// error of the element at the rim varies with its size to the power 2 · 0.54. From an exponent of
/// 3.7 on, this error is smaller than that of fourth-order elements elsewhere.
const GRADING: f64 = 4.0;
/// Smallest position of an element's middle node, as a fraction of the element's length. Near 0.25
/// the element becomes singular, and at 0.5 it does not follow the grading. The stiffness error is
/// several times larger at 0.35 or 0.5 than at this value.
const LEAST_MIDDLE: f64 = 0.45;
/// Thickness of all graded layers around the cylinder together, divided by the smaller of the
/// cylinder's radius and half length.
const NEAR: f64 = 0.4;
/// Largest increase of the radius's natural logarithm per ungraded layer, at refinement level 1.
const FAR_STEP: f64 = 0.9;
/// Radius of the ungraded middle part of the end cap, divided by the cap's radius. On the outer
/// sphere, the middle part takes an equal fraction of the angle up to the rim.
const CORE: f64 = 0.3;
/// Roundness of the edge of the cap's middle part: 0 is a square, 1 a circle. At 0.4 the angles at
/// its corner and at the two nodes beside it are about 120°.
const CORE_ROUNDNESS: f64 = 0.4;

/// Cylinder in a sphere of gel: sizes, orientation and refinement of the mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cylinder {
    /// Length of the cylinder in m.
    pub length_m: f64,
    /// Diameter of the cylinder in m.
    pub diameter_m: f64,
    /// Direction of the cylinder's axis relative to the force.
    pub orientation: Orientation,
    /// Radius of the fixed outer surface in m.
    pub outer_radius_m: f64,
    /// Refinement level 1, 2, 3, …: the number of elements from the cap's middle part to the rim, and
    /// the number of layers graded towards the surface. Half the mantle has twice as many elements.
    /// There are at least four times as many ungraded layers farther out.
    pub level: usize,
}

impl Cylinder {
    /// Permitted range of length divided by diameter.
    pub const ASPECTS: RangeInclusive<f64> = 0.1..=30.0;
    /// Largest distance of the rim from the centre, divided by the outer radius. Beyond it,
    /// elements would be nearly flat.
    pub const LARGEST_REACH: f64 = 0.8;

    /// Builds the mesh. Returns [`Error::Numerical`] if no mesh fits the sizes.
    pub fn mesh(&self) -> Result<Mesh> {
        self.check()?;
        let section = Section::new(self);
        // The field consists of one or two harmonics of the angle around the axis. Two elements per
        // 45° leave an error of 10⁻⁵. Fewer elements are therefore needed around the axis than
        // along the section.
        let n_around = self.level / 2 + 1;
        let long = long_axis(self.orientation);
        let mut n_elements = [n_around; 3];
        n_elements[long] = section.n_cap + section.n_mantle;
        let surface = BoxSurface::new(n_elements);
        Ok(surface.layered(section.n_layers(), |point, sheet| {
            let place = [0, 1, 2].map(|k| point[(long + k) % 3]);
            let half_width = [0, 1, 2].map(|k| surface.half_width[(long + k) % 3]);
            let placed = section.place_m(place, half_width, sheet);
            let mut turned = [0.0; 3];
            for (k, x) in placed.into_iter().enumerate() {
                turned[(long + k) % 3] = x;
            }
            turned
        }))
    }

    fn check(&self) -> Result<()> {
        check_aspect("cylinders", self.length_m, self.diameter_m, &Self::ASPECTS)?;
        let reach = self.length_m.hypot(self.diameter_m) / (2.0 * self.outer_radius_m);
        if !(reach <= Self::LARGEST_REACH && self.outer_radius_m.is_finite() && self.level > 0) {
            return Err(Error::numerical(
                format!(
                    "no mesh of level {} fits: the distance of the cylinder's rim is {reach:.3} outer radii from the centre, and {} is the limit",
                    self.level,
                    Self::LARGEST_REACH
                ),
                format!("check the sizes of robot and vitreous, or use a Gmsh mesh with `{} FILE.msh`", Setting::Mesh),
            ));
        }
        Ok(())
    }
}

/// The mesh in a half plane through the axis. Its nodes are the crossings of lines (from the body
/// to the outer sphere) and sheets (around the body).
struct Section {
    half_length_m: f64,
    radius_m: f64,
    outer_radius_m: f64,
    /// Number of elements along the cap outside its middle part.
    n_cap: usize,
    /// Number of elements along half the mantle.
    n_mantle: usize,
    /// Distance of the start of each line on the cap from the rim, divided by the cap's width
    /// outside its middle part.
    cap: Vec<f64>,
    /// Distance of the start of each line on the mantle from the rim, divided by the half length.
    mantle: Vec<f64>,
    /// Angle from the axis (rad) at which the line from the rim meets the outer sphere.
    rim_angle: f64,
    /// Position of each sheet between the body (0) and the outer sphere (1).
    progress: Vec<f64>,
}

/// A line from the body to the outer sphere.
struct MeridianLine {
    /// Start of the line on the body: its distance along the axis divided by the half length, and
    /// its distance from the axis divided by the radius.
    start: [f64; 2],
    /// Factors by which the line follows a sheet's growth, along the axis and across it. Both are 1
    /// at the rim, so that the lines fan out there.
    spread: [f64; 2],
    /// Angle from the axis (rad) at which the line meets the outer sphere.
    angle: f64,
}

impl Section {
    fn new(cylinder: &Cylinder) -> Self {
        let (half_length_m, radius_m) = (0.5 * cylinder.length_m, 0.5 * cylinder.diameter_m);
        let outer_radius_m = cylinder.outer_radius_m;
        let [n_cap, n_near, n_mantle] = [cylinder.level, cylinder.level, 2 * cylinder.level];
        let small_m = half_length_m.min(radius_m);
        let near_m = NEAR * small_m;
        let far_ratio = outer_radius_m / (small_m + near_m);
        let n_far = cylinder.level * layers_per_level(far_ratio, FAR_STEP);
        let near = graded(n_near).into_iter().map(|t| near_m * t);
        // The layers are in geometric progression, and so are the nodes inside the elements, as in
        // the quarter ball.
        let last = 2 * n_far;
        let far = (1..=last).map(|i| (small_m + near_m) * far_ratio.powf(i as f64 / last as f64) - small_m);
        let mut progress: Vec<f64> = near.chain(far).map(|offset_m| offset_m / (outer_radius_m - small_m)).collect();
        progress[2 * (n_near + n_far)] = 1.0;
        // The angle is 45° for a distant outer sphere. For a near outer sphere it approaches the
        // rim's angle as seen from the centre.
        let reach = half_length_m.hypot(radius_m) / outer_radius_m;
        let rim_angle = (radius_m / half_length_m).powf(reach).atan();
        Self {
            half_length_m,
            radius_m,
            outer_radius_m,
            n_cap,
            n_mantle,
            cap: graded(n_cap),
            mantle: graded(n_mantle),
            rim_angle,
            progress,
        }
    }

    fn n_layers(&self) -> usize {
        self.progress.len() / 2
    }

    /// Node coordinates (m), along the axis first, for a point of the box's surface and a sheet.
    fn place_m(&self, point: [i32; 3], half_width: [i32; 3], sheet: usize) -> [f64; 3] {
        let across = [1, 2].map(|k| f64::from(point[k].abs()) / f64::from(half_width[k]));
        let core = rounded_square(across);
        let core_radius = core[0].hypot(core[1]);
        let [axial_m, radial_m] =
            self.meridian_m(&self.line((half_width[0] - point[0].abs()) as usize, core_radius), sheet);
        // The centre of the cap is on the axis, where no direction is needed.
        let towards = if core_radius > 0.0 { core.map(|c| c / core_radius) } else { [0.0; 2] };
        let signed = |magnitude: f64, k: usize| magnitude * f64::from(point[k].signum());
        [signed(axial_m, 0), signed(radial_m * towards[0], 1), signed(radial_m * towards[1], 2)]
    }

    /// Returns line number `i`, counted from the edge of the cap's middle part towards the rim.
    /// Lines within the middle part have number 0. Their `core_radius` is their distance from the
    /// axis divided by the middle part's radius. The middle part's edge is not quite a circle. The
    /// lines up to the rim compensate for this.
    fn line(&self, i: usize, core_radius: f64) -> MeridianLine {
        let (n_cap, n_mantle) = (2 * self.n_cap, 2 * self.n_mantle);
        let edge = CORE * core_radius;
        if i <= n_cap {
            let outwards = edge + (1.0 - edge) * (i as f64 / n_cap as f64);
            let radial = if i == 0 { edge } else { 1.0 - (1.0 - edge) * self.cap[n_cap - i] };
            MeridianLine { start: [1.0, radial], spread: [1.0, outwards], angle: self.rim_angle * outwards }
        } else {
            let towards_middle = (i - n_cap) as f64 / n_mantle as f64;
            MeridianLine {
                start: [1.0 - self.mantle[i - n_cap], 1.0],
                spread: [1.0 - towards_middle, 1.0],
                angle: self.rim_angle + (FRAC_PI_2 - self.rim_angle) * towards_middle,
            }
        }
    }

    /// Coordinates (m) of the crossing of a line with a sheet: along the axis, and distance from
    /// it.
    fn meridian_m(&self, line: &MeridianLine, sheet: usize) -> [f64; 2] {
        let progress = self.progress[sheet];
        let body = [self.half_length_m, self.radius_m];
        let growth = body.map(|size| (self.outer_radius_m - size) * progress);
        // Sheets change from cylinders to spheres as they become larger than the body. A faster
        // change would move the rim inwards.
        let long_m = self.half_length_m.max(self.radius_m);
        let grown_m = (self.outer_radius_m - long_m) * progress;
        let roundness = if progress == 1.0 {
            1.0
        } else {
            grown_m / (long_m + grown_m) * self.outer_radius_m / (self.outer_radius_m - long_m)
        };
        let (sin, cos) = line.angle.sin_cos();
        let round = [cos, sin];
        std::array::from_fn(|k| {
            let straight_m = body[k] * line.start[k] + growth[k] * line.spread[k];
            (1.0 - roundness) * straight_m + roundness * (body[k] + growth[k]) * round[k]
        })
    }
}

/// Node positions from 0 to 1 of `n` elements that are small near 0.
fn graded(n: usize) -> Vec<f64> {
    let end = |element: usize| (element as f64 / n as f64).powf(GRADING);
    let place = |i: usize| {
        let (lower, upper) = (end(i / 2), end(i.div_ceil(2)));
        if i.is_multiple_of(2) {
            return lower;
        }
        // The geometric mean of the ends follows the grading. The lower limit keeps the element
        // regular.
        let middle = ((lower * upper).sqrt() - lower) / (upper - lower);
        lower + middle.max(LEAST_MIDDLE) * (upper - lower)
    };
    (0..=2 * n).map(place).collect()
}

/// Maps the square [0, 1]² to a square with a rounded corner. The nodes on its outer edge lie at
/// equal angles as seen from the origin.
fn rounded_square(point: [f64; 2]) -> [f64; 2] {
    let [p, q] = point.map(|c| {
        let tangent = (FRAC_PI_4 * c).tan();
        tangent / (1.0 - 0.5 * CORE_ROUNDNESS * (1.0 - tangent * tangent)).sqrt()
    });
    [p * (1.0 - 0.5 * CORE_ROUNDNESS * q * q).sqrt(), q * (1.0 - 0.5 * CORE_ROUNDNESS * p * p).sqrt()]
}
