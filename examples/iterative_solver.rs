//! What an iterative solver takes on the meshes of `factorisations`: conjugate gradients, preconditioned by two grids. The fine one is the program's, smoothed by Gauss and Seidel's
//! sweep; the coarse one keeps the elements' corners alone, and is solved directly.
//!
//! `cargo run --release --example iterative_solver -- LEVEL`, one level a process. Prints one line of JSON: unknowns, seconds of assembly, of the coarse grid, of a solve, its iterations,
//! the robot's displacement (m) at unit modulus and force, and the most memory.

use std::time::Instant;

use faer::Side;
use faer::linalg::solvers::SolveCore;
use faer::prelude::*;
use faer::sparse::linalg::solvers::{Llt, SymbolicLlt};
use faer::sparse::{SparseColMat, SparseColMatRef, Triplet};
use vitreo_uq::error::{Error, Place, Result};
use vitreo_uq::fe::Assembly;
use vitreo_uq::mesh::{ElementKind, HEXAHEDRON27_REFERENCE_NODES, Mesh, QuarterBall};

const POISSON_RATIO: f64 = 0.48;
/// Residual over right-hand side at which a solve ends.
const TOLERANCE: f64 = 1e-10;
const MOST_ITERATIONS: usize = 1_000;
/// Corners come first among the nodes of an element.
const N_CORNERS: usize = 8;

fn main() -> Result<()> {
    faer::set_global_parallelism(faer::Par::Seq);
    let level = std::env::args().nth(1).and_then(|text| text.parse().ok()).filter(|level| (1..=40).contains(level));
    let level: usize =
        level.ok_or_else(|| Error::input(Place::default(), "no level", "give a level of the mesh, from 1 to 40"))?;
    let ball = QuarterBall { robot_radius_m: 0.275e-3, outer_radius_m: 10e-3, n_per_edge: level, n_layers: 4 * level };
    let began = Instant::now();
    let mesh = ball.mesh()?;
    let assembly = Assembly::new(&mesh)?;
    let prolongation = prolongation(&mesh, &assembly);
    let n = assembly.unknowns.count();
    let matrix = Rows::of_symmetric(assembly.unit_stiffness(POISSON_RATIO).as_ref());
    drop((assembly, mesh));
    let assembled_s = began.elapsed().as_secs_f64();
    let began = Instant::now();
    let grids = TwoGrids::new(&matrix, &prolongation)?;
    let coarse_s = began.elapsed().as_secs_f64();
    let began = Instant::now();
    let mut force = vec![0.0; n];
    force[n - 1] = 1.0;
    let (field, n_iterations) = solve(&matrix, &grids, &force)?;
    let line = serde_json::json!({
        "level": level,
        "unknowns": n,
        "assembly_s": assembled_s,
        "coarse_unknowns": grids.n_coarse(),
        "coarse_grid_s": coarse_s,
        "iterations": n_iterations,
        "solve_s": began.elapsed().as_secs_f64(),
        "robot_m": field[n - 1],
        "peak_mib": peak_mib(),
    });
    println!("{line}");
    Ok(())
}

/// A sparse matrix by rows.
struct Rows {
    start: Vec<usize>,
    column: Vec<u32>,
    value: Vec<f64>,
    n_columns: usize,
}

impl Rows {
    fn n(&self) -> usize {
        self.start.len() - 1
    }

    fn row(&self, row: usize) -> impl Iterator<Item = (usize, f64)> {
        let range = self.start[row]..self.start[row + 1];
        self.column[range.clone()].iter().map(|c| *c as usize).zip(self.value[range].iter().copied())
    }

    /// From lists of (column, value), one a row.
    fn collect<L: IntoIterator<Item = (usize, f64)>>(n_columns: usize, rows: impl Iterator<Item = L>) -> Self {
        let mut own = Self { start: vec![0], column: Vec::new(), value: Vec::new(), n_columns };
        for row in rows {
            for (column, value) in row {
                own.column.push(column as u32);
                own.value.push(value);
            }
            own.start.push(own.column.len());
        }
        own
    }

    /// All of a symmetric matrix that is given by its upper triangle.
    fn of_symmetric(upper: SparseColMatRef<'_, u32, f64>) -> Self {
        let n = upper.ncols();
        let mut start = vec![0; n + 1];
        let entries = |column: usize| upper.row_idx_of_col_raw(column).iter().zip(upper.val_of_col(column));
        for column in 0..n {
            for (row, _) in entries(column) {
                start[*row as usize + 1] += 1;
                start[column + 1] += usize::from(*row as usize != column);
            }
        }
        (0..n).for_each(|row| start[row + 1] += start[row]);
        let mut next = start.clone();
        let (mut columns, mut values) = (vec![0; start[n]], vec![0.0; start[n]]);
        let mut put = |row: usize, column: usize, value: f64| {
            (columns[next[row]], values[next[row]]) = (column as u32, value);
            next[row] += 1;
        };
        for column in 0..n {
            for (row, value) in entries(column) {
                put(*row as usize, column, *value);
                if *row as usize != column {
                    put(column, *row as usize, *value);
                }
            }
        }
        Self { start, column: columns, value: values, n_columns: n }
    }

    fn transposed(&self) -> Self {
        let mut lists = vec![Vec::new(); self.n_columns];
        for row in 0..self.n() {
            self.row(row).for_each(|(column, value)| lists[column].push((row, value)));
        }
        Self::collect(self.n(), lists.into_iter())
    }

    /// This times another.
    fn times(&self, other: &Self) -> Self {
        let mut sums = vec![0.0; other.n_columns];
        let mut is_there = vec![false; other.n_columns];
        let mut there: Vec<usize> = Vec::new();
        let rows = (0..self.n()).map(|row| {
            for (middle, a) in self.row(row) {
                for (column, b) in other.row(middle) {
                    if !std::mem::replace(&mut is_there[column], true) {
                        there.push(column);
                    }
                    sums[column] += a * b;
                }
            }
            let list: Vec<(usize, f64)> = there.iter().map(|c| (*c, std::mem::take(&mut sums[*c]))).collect();
            there.drain(..).for_each(|column| is_there[column] = false);
            list
        });
        Self::collect(other.n_columns, rows)
    }

    fn product(&self, x: &[f64]) -> Vec<f64> {
        (0..self.n()).map(|row| self.row(row).map(|(column, value)| value * x[column]).sum()).collect()
    }

    /// One of Gauss and Seidel's sweeps towards A x = b, in place.
    fn sweep(&self, rows: impl Iterator<Item = usize>, b: &[f64], x: &mut [f64]) {
        for row in rows {
            let (mut sum, mut diagonal) = (b[row], 1.0);
            for (column, value) in self.row(row) {
                sum -= value * x[column];
                if column == row {
                    diagonal = value;
                }
            }
            x[row] += sum / diagonal;
        }
    }
}

/// Unknowns of the fine grid from those of the coarse one, which are the fine ones that belong to corners: trilinear inside an element.
fn prolongation(mesh: &Mesh, assembly: &Assembly) -> Rows {
    assert_eq!(mesh.element_kind, ElementKind::Hexahedron27, "built-in meshes around spheres have these elements");
    let n = assembly.unknowns.count();
    // The unknown of every component of every node, counted from 1; 0 where it is fixed.
    let numbers: Vec<f64> = (1..=n).map(|number| number as f64).collect();
    let unknowns: Vec<[usize; 3]> =
        assembly.unknowns.nodal_displacement(&numbers).into_iter().map(|node| node.map(|u| u as usize)).collect();
    let mut coarse: Vec<Option<usize>> = vec![None; n + 1];
    let mut n_coarse = 0;
    let corners = |nodes: &[u32]| nodes[..N_CORNERS].iter().map(|node| *node as usize).collect::<Vec<_>>();
    for nodes in mesh.elements() {
        for unknown in corners(nodes).into_iter().flat_map(|node| unknowns[node]).filter(|u| *u > 0) {
            coarse[unknown].get_or_insert_with(|| {
                n_coarse += 1;
                n_coarse - 1
            });
        }
    }
    let mut rows: Vec<Vec<(usize, f64)>> = vec![Vec::new(); n];
    for nodes in mesh.elements() {
        for (node, place) in nodes.iter().zip(&HEXAHEDRON27_REFERENCE_NODES) {
            for component in 0..3 {
                let unknown = unknowns[*node as usize][component];
                if unknown == 0 || !rows[unknown - 1].is_empty() {
                    continue;
                }
                let row = &mut rows[unknown - 1];
                for (corner, at) in corners(nodes).into_iter().zip(&HEXAHEDRON27_REFERENCE_NODES) {
                    let weight: f64 = (0..3).map(|d| 0.5 * (1.0 + at[d] * place[d])).product();
                    let Some(column) = coarse[unknowns[corner][component]] else { continue };
                    if weight > 0.0 {
                        // Corners on the robot share an unknown.
                        match row.iter_mut().find(|own| own.0 == column) {
                            Some(own) => own.1 += weight,
                            None => row.push((column, weight)),
                        }
                    }
                }
            }
        }
    }
    Rows::collect(n_coarse, rows.into_iter())
}

/// The preconditioner.
struct TwoGrids<'a> {
    fine: &'a Rows,
    up: &'a Rows,
    down: Rows,
    coarse: Llt<usize, f64>,
}

impl<'a> TwoGrids<'a> {
    /// Projects the fine matrix and factorises it.
    fn new(fine: &'a Rows, up: &'a Rows) -> Result<Self> {
        let down = up.transposed();
        let projected = down.times(&fine.times(up));
        let entries: Vec<_> = (0..projected.n())
            .flat_map(|row| {
                projected.row(row).filter(move |(column, _)| *column <= row).map(move |(c, v)| Triplet::new(row, c, v))
            })
            .collect();
        let refused = |what: String| Error::numerical(what, "take a coarser mesh");
        let lower = SparseColMat::<usize, f64>::try_new_from_triplets(projected.n(), projected.n(), &entries)
            .map_err(|error| refused(format!("{error:?}")))?;
        let symbolic = SymbolicLlt::try_new(lower.symbolic(), Side::Lower).map_err(|e| refused(format!("{e:?}")))?;
        let coarse = Llt::try_new_with_symbolic(symbolic, lower.as_ref(), Side::Lower)
            .map_err(|error| refused(format!("the coarse grid is not positive definite: {error:?}")))?;
        Ok(Self { fine, up, down, coarse })
    }

    fn n_coarse(&self) -> usize {
        self.down.n()
    }

    /// A sweep, the coarse grid's correction, and the sweep in the other order: symmetric and positive definite.
    fn apply(&self, residual: &[f64]) -> Vec<f64> {
        let n = residual.len();
        let mut x = vec![0.0; n];
        self.fine.sweep(0..n, residual, &mut x);
        let left: Vec<f64> = residual.iter().zip(self.fine.product(&x)).map(|(r, ax)| r - ax).collect();
        let mut correction = self.down.product(&left);
        let n_coarse = correction.len();
        let column = MatMut::from_column_major_slice_mut(&mut correction, n_coarse, 1);
        self.coarse.solve_in_place_with_conj(faer::Conj::No, column);
        x.iter_mut().zip(self.up.product(&correction)).for_each(|(x, c)| *x += c);
        self.fine.sweep((0..n).rev(), residual, &mut x);
        x
    }
}

/// Conjugate gradients from 0; the solution and the number of iterations.
fn solve(matrix: &Rows, grids: &TwoGrids, force: &[f64]) -> Result<(Vec<f64>, usize)> {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let mut x = vec![0.0; force.len()];
    let mut residual = force.to_vec();
    let mut z = grids.apply(&residual);
    let mut direction = z.clone();
    let mut rho = dot(&residual, &z);
    let goal = TOLERANCE * dot(force, force).sqrt();
    for iteration in 1..=MOST_ITERATIONS {
        let image = matrix.product(&direction);
        let step = rho / dot(&direction, &image);
        x.iter_mut().zip(&direction).for_each(|(x, d)| *x += step * d);
        residual.iter_mut().zip(&image).for_each(|(r, a)| *r -= step * a);
        if dot(&residual, &residual).sqrt() <= goal {
            return Ok((x, iteration));
        }
        z = grids.apply(&residual);
        let next = dot(&residual, &z);
        direction.iter_mut().zip(&z).for_each(|(d, z)| *d = z + next / rho * *d);
        rho = next;
    }
    Err(Error::numerical(format!("{MOST_ITERATIONS} iterations were too few"), "take a smaller Poisson ratio"))
}

/// The most memory that this process has held, as Linux tells.
fn peak_mib() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM"))?;
    line.split_whitespace().nth(1)?.parse::<f64>().ok().map(|kib| kib / 1024.0)
}
