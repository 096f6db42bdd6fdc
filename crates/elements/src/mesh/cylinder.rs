//! Built-in mesh of the gel between a circular cylinder and the outer sphere, graded towards the cylinder's sharp rim.
//!
//! In a section through the axis lines run from the end cap and from the mantle to the outer surface, and fan out at the rim; sheets around the body
//! are first cylinders that keep their distance from it, with the same sharp rim, and become spheres. At the rim the stress is singular: the
//! displacement goes with the distance to the power 0.54 at ν = ½ (0.6 at 0.3), and elements of one size would leave per cents of error. So
//! elements shrink towards the rim along the cap, along the mantle and across the sheets, with the power [`GRADING`] of their number.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};
use std::ops::RangeInclusive;

use super::Mesh;
use super::box_surface::{BoxSurface, layers_per_level, long_axis};
use base::error::{Error, Result, Setting};
use record::Orientation;

/// Power that places of nodes are graded by. An element's error in the energy goes with its size to the power 2 · 0.54 at the rim; from 3.7 on that is
/// less than what elements of fourth order leave elsewhere.
const GRADING: f64 = 4.0;
/// Smallest place of an element's middle node between its ends. Towards ¼ the element itself becomes singular, at ½ it does not stretch as the
/// grading does: at 0.35 and at ½ the stiffness error is several times larger.
const LEAST_MIDDLE: f64 = 0.45;
/// Thickness of the layers that are graded towards the surface, in units of the smaller of radius and half length.
const NEAR: f64 = 0.4;
/// Largest step of ln r in the layers beyond, at level 1.
const FAR_STEP: f64 = 0.9;
/// Radius of the end cap's middle, where elements are not graded, over the cap's; and its share of the angle up to the rim on the outer sphere.
const CORE: f64 = 0.3;
/// How round the edge of the cap's middle is: 0 is a square, 1 a circle. At 0.4 its corner and the two beside it have about 120° each.
const CORE_ROUNDNESS: f64 = 0.4;

/// Sizes and fineness of the mesh around a cylinder.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cylinder {
    /// Length in m.
    pub length_m: f64,
    /// Diameter in m.
    pub diameter_m: f64,
    /// Axis relative to the force.
    pub orientation: Orientation,
    /// Radius of the fixed outer surface in m.
    pub outer_radius_m: f64,
    /// 1, 2, 3, …: elements from the cap's middle to the rim, and layers graded towards the surface; there are twice as many along half the mantle and
    /// at least four times as many layers farther out.
    pub level: usize,
}

impl Cylinder {
    /// Length over diameter that is meshed.
    pub const ASPECTS: RangeInclusive<f64> = 0.1..=30.0;
    /// Largest distance of the rim from the centre, over the outer radius: nearer to it elements would be flat.
    pub const LARGEST_REACH: f64 = 0.8;

    /// The mesh, or [`Error::Numerical`] where the sizes make none.
    pub fn mesh(&self) -> Result<Mesh> {
        self.check()?;
        let section = Section::new(self);
        // Around the axis the field is a harmonic or two: two elements in 45° leave 10⁻⁵, and fewer are needed than along the section.
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
        let aspect = self.length_m / self.diameter_m;
        if !(self.diameter_m > 0.0 && Self::ASPECTS.contains(&aspect)) {
            return Err(Error::numerical(
                format!(
                    "the built-in meshes are of cylinders from {} to {} times as long as wide, and this one is {aspect:.3} times",
                    Self::ASPECTS.start(),
                    Self::ASPECTS.end()
                ),
                format!(
                    "check the robot's length and diameter, or bring a Gmsh mesh with `{} FILE.msh`",
                    Setting::Mesh
                ),
            ));
        }
        let reach = self.length_m.hypot(self.diameter_m) / (2.0 * self.outer_radius_m);
        if !(reach <= Self::LARGEST_REACH && self.outer_radius_m.is_finite() && self.level > 0) {
            return Err(Error::numerical(
                format!(
                    "no mesh of level {} fits: the cylinder's rim is {reach:.3} of the outer radius from the centre, and {} is the most",
                    self.level,
                    Self::LARGEST_REACH
                ),
                format!(
                    "check the sizes of robot and vitreous, or bring a Gmsh mesh with `{} FILE.msh`",
                    Setting::Mesh
                ),
            ));
        }
        Ok(())
    }
}

/// The mesh in a half plane through the axis: where lines and sheets cross.
struct Section {
    half_length_m: f64,
    radius_m: f64,
    outer_radius_m: f64,
    /// Elements along the cap outside its middle.
    n_cap: usize,
    /// Elements along half the mantle.
    n_mantle: usize,
    /// Distances of the lines from the rim: along the cap over its width outside the middle, along the mantle over the half length.
    cap: Vec<f64>,
    mantle: Vec<f64>,
    /// Angle from the axis at which the rim's line meets the outer sphere.
    rim_angle: f64,
    /// How far each sheet is on its way to the outer sphere, 0 to 1.
    progress: Vec<f64>,
}

/// Where a line leaves the body and how it goes on.
struct Line {
    /// Start over half length and radius: a point of the unit square's edge.
    start: [f64; 2],
    /// Direction in which it keeps its distance from cap or mantle; (1, 1) at the rim, so that the lines fan out there.
    spread: [f64; 2],
    /// Angle from the axis where it meets the outer sphere.
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
        // Geometric progression, also inside the elements, as in the quarter ball.
        let last = 2 * n_far;
        let far = (1..=last).map(|i| (small_m + near_m) * far_ratio.powf(i as f64 / last as f64) - small_m);
        let mut progress: Vec<f64> = near.chain(far).map(|offset_m| offset_m / (outer_radius_m - small_m)).collect();
        progress[2 * (n_near + n_far)] = 1.0;
        // 45° where the outer sphere is far away, the rim's own direction where it is near.
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

    /// Coordinates in m (along the axis first) of a point of the box's surface on a sheet.
    fn place_m(&self, point: [i32; 3], half_width: [i32; 3], sheet: usize) -> [f64; 3] {
        let across = [1, 2].map(|k| f64::from(point[k].abs()) / f64::from(half_width[k]));
        let core = rounded_square(across);
        let core_radius = core[0].hypot(core[1]);
        let [axial_m, radial_m] =
            self.meridian_m(&self.line((half_width[0] - point[0].abs()) as usize, core_radius), sheet);
        // The middle of the cap is on the axis, where no direction is needed.
        let towards = if core_radius > 0.0 { core.map(|c| c / core_radius) } else { [0.0; 2] };
        let signed = |magnitude: f64, k: usize| magnitude * f64::from(point[k].signum());
        [signed(axial_m, 0), signed(radial_m * towards[0], 1), signed(radial_m * towards[1], 2)]
    }

    /// The line number `i` counted from the edge of the cap's middle; all lines of the middle have number 0 and differ by `core_radius`, their distance
    /// from the axis over the middle's radius. Its edge is not quite a circle, and up to the rim the lines make up for that.
    fn line(&self, i: usize, core_radius: f64) -> Line {
        let (n_cap, n_mantle) = (2 * self.n_cap, 2 * self.n_mantle);
        let edge = CORE * core_radius;
        if i <= n_cap {
            let outwards = edge + (1.0 - edge) * (i as f64 / n_cap as f64);
            let radial = if i == 0 { edge } else { 1.0 - (1.0 - edge) * self.cap[n_cap - i] };
            Line { start: [1.0, radial], spread: [1.0, outwards], angle: self.rim_angle * outwards }
        } else {
            let towards_middle = (i - n_cap) as f64 / n_mantle as f64;
            Line {
                start: [1.0 - self.mantle[i - n_cap], 1.0],
                spread: [1.0 - towards_middle, 1.0],
                angle: self.rim_angle + (FRAC_PI_2 - self.rim_angle) * towards_middle,
            }
        }
    }

    /// Distances (m) along and from the axis of a line's crossing with a sheet.
    fn meridian_m(&self, line: &Line, sheet: usize) -> [f64; 2] {
        let progress = self.progress[sheet];
        let body = [self.half_length_m, self.radius_m];
        let growth = body.map(|size| (self.outer_radius_m - size) * progress);
        // From cylinders to spheres in the measure in which the sheets outgrow the body; faster, and the rim would move inwards.
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

/// Places 0 to 1 of the nodes of `n` elements that are small at 0.
fn graded(n: usize) -> Vec<f64> {
    let end = |element: usize| (element as f64 / n as f64).powf(GRADING);
    let place = |i: usize| {
        let (lower, upper) = (end(i / 2), end(i.div_ceil(2)));
        if i.is_multiple_of(2) {
            return lower;
        }
        // The geometric mean, which follows the grading, as far as the element allows.
        let middle = ((lower * upper).sqrt() - lower) / (upper - lower);
        lower + middle.max(LEAST_MIDDLE) * (upper - lower)
    };
    (0..=2 * n).map(place).collect()
}

/// Maps the square [0, 1]² on a square with a rounded corner, such that the nodes on its edge stand at equal angles as seen from the origin.
fn rounded_square(point: [f64; 2]) -> [f64; 2] {
    let [p, q] = point.map(|c| {
        let tangent = (FRAC_PI_4 * c).tan();
        tangent / (1.0 - 0.5 * CORE_ROUNDNESS * (1.0 - tangent * tangent)).sqrt()
    });
    [p * (1.0 - 0.5 * CORE_ROUNDNESS * q * q).sqrt(), q * (1.0 - 0.5 * CORE_ROUNDNESS * p * p).sqrt()]
}
