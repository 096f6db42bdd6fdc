//! Mesh of the gel between the robot, a body of revolution, and the outer sphere. It lies on the
//! half meridian r ≥ 0, and covers either z ≥ 0 or both halves.

use super::geometry::{Curve, Point, Ruled};

/// Parts of the boundary on which a vertex lies. An edge lies on a part if both its end vertices
/// do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(in crate::fe) struct Boundary {
    pub(in crate::fe) body: bool,
    pub(in crate::fe) outer: bool,
    /// True if the vertex lies on the axis, r = 0.
    pub(in crate::fe) axis: bool,
    /// True if the vertex lies on the plane of symmetry, z = 0.
    pub(in crate::fe) equator: bool,
}

impl Boundary {
    pub(in crate::fe) const INSIDE: Self = Self { body: false, outer: false, axis: false, equator: false };

    /// Returns the parts of the boundary that contain both vertices.
    pub(in crate::fe) fn and(self, other: Self) -> Self {
        Self {
            body: self.body && other.body,
            outer: self.outer && other.outer,
            axis: self.axis && other.axis,
            equator: self.equator && other.equator,
        }
    }
}

/// A cell: its map from the unit square, and its vertices in the order inner start, inner end,
/// outer start, outer end. Two vertices may coincide.
#[derive(Debug, Clone, Copy)]
pub(in crate::fe) struct Cell {
    pub(in crate::fe) vertices: [usize; 4],
    pub(in crate::fe) map: Ruled,
}

/// Cells of the half meridian and their vertices. `boundaries` gives the parts of the boundary on
/// which each vertex lies.
#[derive(Debug, Clone, Default)]
pub(in crate::fe) struct Mesh {
    pub points: Vec<Point>,
    pub(in crate::fe) boundaries: Vec<Boundary>,
    pub(in crate::fe) cells: Vec<Cell>,
    /// True if both halves z > 0 and z < 0 are meshed, without symmetry about z = 0.
    pub(in crate::fe) is_whole: bool,
}

/// A sequence of curves from vertex to vertex. It runs from the axis towards the equator.
#[derive(Debug, Clone)]
pub(in crate::fe) struct Chain {
    pub(in crate::fe) vertices: Vec<usize>,
    pub(in crate::fe) curves: Vec<Curve>,
}

impl Mesh {
    /// Adds a vertex. It lies on the axis if r is exactly 0, and on the equator if z is exactly 0.
    /// `surface` gives its other parts of the boundary.
    pub(in crate::fe) fn vertex(&mut self, point: Point, surface: Boundary) -> usize {
        self.points.push(point);
        self.boundaries.push(Boundary { axis: point[0] == 0.0, equator: point[1] == 0.0 && !self.is_whole, ..surface });
        self.points.len() - 1
    }

    /// Returns the chain of straight lines through the given vertices.
    pub(in crate::fe) fn polyline(&self, vertices: &[usize]) -> Chain {
        let segment = |pair: &[usize]| Curve::Segment { from: self.points[pair[0]], to: self.points[pair[1]] };
        Chain { vertices: vertices.to_vec(), curves: vertices.windows(2).map(segment).collect() }
    }

    /// Adds vertices at given angles on an ellipse around `centre`, and joins them by arcs. Angles
    /// are in rad, counted from the equator. On an ellipse around the origin, the angles 0 and ±π/2
    /// give points exactly on the equator and the axis.
    pub(in crate::fe) fn arcs(
        &mut self,
        centre: Point,
        semi_axes: Point,
        angles_rad: &[f64],
        surface: Boundary,
    ) -> Chain {
        let arc = |pair: &[f64]| Curve::Arc { centre, semi_axes, from_rad: pair[0], to_rad: pair[1] };
        let curves: Vec<_> = angles_rad.windows(2).map(arc).collect();
        let vertices = angles_rad
            .iter()
            .map(|&angle| {
                let cos = if angle.abs() == std::f64::consts::FRAC_PI_2 { 0.0 } else { angle.cos() };
                self.vertex([centre[0] + semi_axes[0] * cos, centre[1] + semi_axes[1] * angle.sin()], surface)
            })
            .collect();
        Chain { vertices, curves }
    }

    /// Adds one cell between the k-th curves of two chains, for every k.
    pub(in crate::fe) fn rule(&mut self, inner: &Chain, outer: &Chain) {
        self.rule_layers(inner, outer, &[0.0, 1.0]);
    }

    /// Adds layers of cells between the chains `inner` and `outer`. The ascending `fractions`, from
    /// 0 to 1, are the boundaries of the layers, as parts of the distance between the chains.
    pub(in crate::fe) fn rule_layers(&mut self, inner: &Chain, outer: &Chain, fractions: &[f64]) {
        let mut from = inner.vertices.clone();
        for across in fractions.windows(2) {
            let to = if across[1] == 1.0 { outer.vertices.clone() } else { self.between(inner, outer, across[1]) };
            for (i, (&a, &b)) in inner.curves.iter().zip(&outer.curves).enumerate() {
                self.cells.push(Cell {
                    vertices: [from[i], from[i + 1], to[i], to[i + 1]],
                    map: Ruled { inner: a, outer: b, across: [across[0], across[1]] },
                });
            }
            from = to;
        }
    }

    /// Mirrors a mesh of the upper half and returns both halves.
    pub(in crate::fe) fn whole(&self) -> Self {
        let mut whole = Self { is_whole: true, cells: self.cells.clone(), ..Self::default() };
        for (point, boundary) in self.points.iter().zip(&self.boundaries) {
            whole.vertex(*point, *boundary);
        }
        let image = |vertex: usize| {
            let ([r, z], boundary) = (self.points[vertex], self.boundaries[vertex]);
            if boundary.equator { vertex } else { whole.vertex([r, -z], boundary) }
        };
        let images: Vec<usize> = (0..self.points.len()).map(image).collect();
        for cell in &self.cells {
            let [a, b, c, d] = cell.vertices.map(|vertex| images[vertex]);
            whole.cells.push(Cell { vertices: [b, a, d, c], map: cell.map.mirrored() });
        }
        whole
    }

    /// Adds vertices between two chains and returns their indices. `fraction` is their distance
    /// from the inner chain, divided by the distance between the chains.
    fn between(&mut self, inner: &Chain, outer: &Chain, fraction: f64) -> Vec<usize> {
        let pairs = inner.vertices.iter().zip(&outer.vertices);
        let points: Vec<Point> = pairs
            .map(|(&a, &b)| [0, 1].map(|d| (1.0 - fraction) * self.points[a][d] + fraction * self.points[b][d]))
            .collect();
        points.into_iter().map(|point| self.vertex(point, Boundary::INSIDE)).collect()
    }
}

/// Returns distances 0 = x₀ < … < xₙ = `length`. The first step is about `first`, and each distance
/// is at most `ratio` times the previous one.
pub(in crate::fe) fn graded(first: f64, ratio: f64, length: f64) -> Vec<f64> {
    if first >= length {
        return vec![0.0, length];
    }
    let n = ((length / first).ln() / ratio.ln()).ceil();
    let distance = |k: usize| length * (first / length).powf(1.0 - k as f64 / n);
    std::iter::once(0.0).chain((0..n as usize).map(distance)).chain([length]).collect()
}
