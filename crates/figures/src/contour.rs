//! Contour lines of a function on a regular grid (marching squares).

use std::collections::HashMap;

/// Values of a function at the nodes of a regular grid. Positions are in units of cells, with node (0, 0) at the origin.
#[derive(Debug, Clone)]
pub struct Grid {
    /// Number of nodes along the first coordinate.
    pub columns: usize,
    /// Number of nodes along the second coordinate.
    pub rows: usize,
    /// Values at the nodes, in the order `values[row * columns + column]`.
    pub values: Vec<f64>,
}

/// Edge between two neighbouring nodes: column and row of its lower-left node, and true if it runs along the second coordinate.
type Edge = (isize, isize, bool);

impl Grid {
    /// Value at a node. It is zero outside the grid, so that every contour is closed.
    fn node(&self, column: isize, row: isize) -> f64 {
        let inside = column >= 0 && row >= 0 && column < self.columns as isize && row < self.rows as isize;
        if inside { self.values[row as usize * self.columns + column as usize] } else { 0.0 }
    }

    /// Value at a point by bilinear interpolation; zero outside the grid.
    pub fn interpolate(&self, (x, y): (f64, f64)) -> f64 {
        if !(x > -1.0 && y > -1.0 && x < self.columns as f64 && y < self.rows as f64) {
            return 0.0;
        }
        let (column, row) = (x.floor(), y.floor());
        let (s, t) = (x - column, y - row);
        let (c, r) = (column as isize, row as isize);
        let lower = (1.0 - s) * self.node(c, r) + s * self.node(c + 1, r);
        let upper = (1.0 - s) * self.node(c, r + 1) + s * self.node(c + 1, r + 1);
        (1.0 - t) * lower + t * upper
    }

    /// Closed loops along which the interpolated function equals `level`, a positive number. Filled by the even-odd rule, they cover the region above the
    /// level.
    pub fn contour(&self, level: f64) -> Vec<Vec<(f64, f64)>> {
        if level <= 0.0 || level.is_nan() {
            return Vec::new();
        }
        let mut segments: Vec<(Edge, Edge)> = Vec::new();
        for row in -1..self.rows as isize {
            for column in -1..self.columns as isize {
                self.segments_of_cell(column, row, level, &mut segments);
            }
        }
        join(&segments)
            .into_iter()
            .map(|edges| edges.into_iter().map(|edge| self.crossing(edge, level)).collect())
            .collect()
    }

    fn segments_of_cell(&self, c: isize, r: isize, level: f64, segments: &mut Vec<(Edge, Edge)>) {
        let corners = [self.node(c, r), self.node(c + 1, r), self.node(c + 1, r + 1), self.node(c, r + 1)];
        let above = corners.map(|value| value > level);
        // Edge i runs from corner i to corner i + 1. The order is below, right, above, left.
        let edges: [Edge; 4] = [(c, r, false), (c + 1, r, true), (c, r + 1, false), (c, r, true)];
        let crossed: Vec<usize> = (0..4).filter(|&i| above[i] != above[(i + 1) % 4]).collect();
        match crossed[..] {
            [i, j] => segments.push((edges[i], edges[j])),
            [_, _, _, _] => {
                // At a saddle point, the value in the centre decides which opposite corners are connected.
                let centre_above = corners.iter().sum::<f64>() / 4.0 > level;
                let cut_first_corner = centre_above != above[0];
                let pairs = if cut_first_corner { [(3, 0), (1, 2)] } else { [(0, 1), (2, 3)] };
                segments.extend(pairs.map(|(i, j)| (edges[i], edges[j])));
            }
            _ => {}
        }
    }

    fn crossing(&self, (column, row, upwards): Edge, level: f64) -> (f64, f64) {
        let (next_column, next_row) = if upwards { (column, row + 1) } else { (column + 1, row) };
        let (first, second) = (self.node(column, row), self.node(next_column, next_row));
        let part = (level - first) / (second - first);
        let along = |start: isize, end: isize| start as f64 + part * (end - start) as f64;
        (along(column, next_column), along(row, next_row))
    }
}

/// Joins segments into closed loops, in a deterministic order. Segments that share an edge are neighbours.
fn join(segments: &[(Edge, Edge)]) -> Vec<Vec<Edge>> {
    let mut at_edge: HashMap<Edge, Vec<usize>> = HashMap::with_capacity(segments.len());
    for (i, &(a, b)) in segments.iter().enumerate() {
        at_edge.entry(a).or_default().push(i);
        at_edge.entry(b).or_default().push(i);
    }
    let mut used = vec![false; segments.len()];
    let mut loops = Vec::new();
    for start in 0..segments.len() {
        if used[start] {
            continue;
        }
        used[start] = true;
        let (first, mut end) = segments[start];
        let mut points = vec![first];
        while end != first {
            points.push(end);
            let next = at_edge.get(&end).and_then(|list| list.iter().copied().find(|&i| !used[i]));
            let Some(next) = next else { break };
            used[next] = true;
            let (a, b) = segments[next];
            end = if a == end { b } else { a };
        }
        loops.push(points);
    }
    loops
}

/// Simplifies a polyline (Ramer, Douglas, Peucker): removes points that are within `tolerance` of the line through the remaining neighbours.
pub fn simplify(points: &[(f64, f64)], tolerance: f64) -> Vec<(f64, f64)> {
    if points.len() < 3 {
        return points.to_vec();
    }
    let mut keep = vec![false; points.len()];
    keep[0] = true;
    keep[points.len() - 1] = true;
    let mut pending = vec![(0, points.len() - 1)];
    while let Some((first, last)) = pending.pop() {
        let distances = (first + 1..last).map(|i| (distance_to_line(points[i], points[first], points[last]), i));
        let farthest = distances.max_by(|a, b| a.0.total_cmp(&b.0));
        if let Some((distance, i)) = farthest
            && distance > tolerance
        {
            keep[i] = true;
            pending.extend([(first, i), (i, last)]);
        }
    }
    points.iter().zip(keep).filter(|(_, keep)| *keep).map(|(point, _)| *point).collect()
}

fn distance_to_line(p: (f64, f64), a: (f64, f64), b: (f64, f64)) -> f64 {
    let (dx, dy) = (b.0 - a.0, b.1 - a.1);
    let length = dx.hypot(dy);
    if length == 0.0 {
        return (p.0 - a.0).hypot(p.1 - a.1);
    }
    ((p.0 - a.0) * dy - (p.1 - a.1) * dx).abs() / length
}

#[cfg(test)]
pub mod tests {
    use super::*;

    /// Signed area inside a closed loop (shoelace formula). It is positive if the loop runs anticlockwise.
    pub fn signed_area(points: &[(f64, f64)]) -> f64 {
        let next = points.iter().cycle().skip(1);
        points.iter().zip(next).map(|(a, b)| 0.5 * (a.0 * b.1 - b.0 * a.1)).sum()
    }

    fn grid(n: usize, f: impl Fn(f64, f64) -> f64) -> Grid {
        let values = (0..n * n).map(|k| f((k % n) as f64, (k / n) as f64)).collect();
        Grid { columns: n, rows: n, values }
    }

    #[test]
    fn circles_have_their_area() {
        let disc = grid(101, |x, y| (-((x - 50.0).powi(2) + (y - 50.0).powi(2)) / 400.0).exp());
        let loops = disc.contour((-1.0f64).exp());
        assert_eq!(loops.len(), 1);
        let area = signed_area(&loops[0]).abs();
        assert!((area / (std::f64::consts::PI * 400.0) - 1.0).abs() < 2e-3, "{area}");
        assert!((signed_area(&simplify(&loops[0], 0.05)).abs() / area - 1.0).abs() < 1e-2);
    }

    #[test]
    fn a_ring_is_two_loops_and_two_hills_are_two_loops() {
        let ring = grid(101, |x, y| (-((x - 50.0).hypot(y - 50.0) - 30.0).powi(2) / 50.0).exp());
        assert_eq!(ring.contour(0.5).len(), 2);
        let hill = |x: f64, y: f64, cx: f64| (-((x - cx).powi(2) + (y - 50.0).powi(2)) / 60.0).exp();
        assert_eq!(grid(101, |x, y| hill(x, y, 25.0) + hill(x, y, 75.0)).contour(0.5).len(), 2);
    }

    #[test]
    fn contours_close_at_the_edge_and_through_saddles() {
        let everything = grid(5, |_, _| 1.0);
        let loops = everything.contour(0.5);
        assert_eq!(loops.len(), 1);
        assert!((signed_area(&loops[0]).abs() - (25.0 - 0.5)).abs() < 1.0);
        let chess = grid(6, |x, y| f64::from((x + y) as i32 % 2));
        let loops = chess.contour(0.4);
        assert!(loops.iter().all(|points| points.len() >= 3));
    }
}
