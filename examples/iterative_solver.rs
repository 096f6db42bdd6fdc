//! Measures an iterative solver on the meshes of `factorisations`: conjugate gradients with a two-grid preconditioner. The fine grid is that of the program,
//! and Gauss–Seidel sweeps smooth its residual. The coarse grid keeps only the elements' corners and is solved directly.
//!
//! `cargo run --release --example iterative_solver -- LEVEL` handles one level and prints one line of JSON: unknowns, seconds of assembly, of the coarse grid
//! and of a solve, its iterations, the robot's displacement (m) at unit modulus and force, and the peak memory.

use std::time::Instant;

use faer::Side;
use faer::linalg::solvers::SolveCore;
use faer::prelude::*;
use faer::sparse::linalg::solvers::{Llt, SymbolicLlt};
use faer::sparse::{SparseColMat, SparseColMatRef, SymbolicSparseColMat, Triplet};
use vitreo_uq::base::error::{Error, Result};
use vitreo_uq::elements::fe::Assembly;
use vitreo_uq::elements::mesh::{ElementKind, HEXAHEDRON27_REFERENCE_NODES, Mesh};

#[path = "shared/solver_mesh.rs"]
mod solver_mesh;

use solver_mesh::{POISSON_RATIO, asked_for, peak_mib};

/// Ratio of residual to right-hand side at which a solve ends.
const TOLERANCE: f64 = 1e-10;
const MOST_ITERATIONS: usize = 1_000;
/// Number of corners of an element. They come first among its nodes.
const N_CORNERS: usize = 8;

type Matrix = SparseColMat<u32, f64>;

fn main() -> Result<()> {
    faer::set_global_parallelism(faer::Par::Seq);
    let (level, ball) = asked_for()?;
    let began = Instant::now();
    let mesh = ball.mesh()?;
    let assembly = Assembly::new(&mesh)?;
    let up = prolongation(&mesh, &assembly)?;
    let n = assembly.unknowns.count();
    let matrix = whole(assembly.unit_stiffness(POISSON_RATIO).as_ref());
    drop((assembly, mesh));
    let assembled_s = began.elapsed().as_secs_f64();
    let began = Instant::now();
    let grids = TwoGrids::new(&matrix, &up)?;
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

fn refused(what: String) -> Error {
    Error::numerical(what, "take a coarser mesh, or a smaller Poisson ratio")
}

/// Returns a full symmetric matrix, given its upper triangle.
fn whole(upper: SparseColMatRef<'_, u32, f64>) -> Matrix {
    let n = upper.ncols();
    let mut start = vec![0_u32; n + 1];
    let entries = |column: usize| upper.row_idx_of_col(column).zip(upper.val_of_col(column));
    for column in 0..n {
        for (row, _) in entries(column) {
            start[row + 1] += 1;
            start[column + 1] += u32::from(row != column);
        }
    }
    (0..n).for_each(|column| start[column + 1] += start[column]);
    let mut next = start.clone();
    let (mut rows, mut values) = (vec![0; start[n] as usize], vec![0.0; start[n] as usize]);
    let mut put = |row: usize, column: usize, value: f64| {
        (rows[next[column] as usize], values[next[column] as usize]) = (row as u32, value);
        next[column] += 1;
    };
    // Columns come in order, so every column is filled from its first row to its last.
    for column in 0..n {
        for (row, value) in entries(column) {
            put(row, column, *value);
            if row != column {
                put(column, row, *value);
            }
        }
    }
    Matrix::new(SymbolicSparseColMat::new_checked(n, n, start, None, rows), values)
}

/// Product of the transposed matrix with a vector. For a symmetric matrix it equals the product with the matrix itself.
fn products(matrix: &Matrix, x: &[f64]) -> Vec<f64> {
    let of = |column: usize| {
        matrix.row_idx_of_col(column).zip(matrix.val_of_col(column)).map(|(row, value)| value * x[row]).sum()
    };
    (0..matrix.ncols()).map(of).collect()
}

/// Runs one in-place Gauss–Seidel sweep towards the solution x of A x = b, where `matrix` is the symmetric A.
fn sweep(matrix: &Matrix, unknowns: impl Iterator<Item = usize>, b: &[f64], x: &mut [f64]) {
    for unknown in unknowns {
        let (mut sum, mut diagonal) = (b[unknown], 1.0);
        for (other, value) in matrix.row_idx_of_col(unknown).zip(matrix.val_of_col(unknown)) {
            sum -= value * x[other];
            if other == unknown {
                diagonal = *value;
            }
        }
        x[unknown] += sum / diagonal;
    }
}

/// Prolongation from the coarse to the fine grid: trilinear inside an element. The coarse unknowns are the fine ones at corners.
fn prolongation(mesh: &Mesh, assembly: &Assembly) -> Result<Matrix> {
    assert_eq!(mesh.element_kind, ElementKind::Hexahedron27, "built-in meshes around spheres have these elements");
    let n = assembly.unknowns.count();
    // Number of each component's unknown at every node, from 1; 0 if it is fixed.
    let numbers: Vec<f64> = (1..=n).map(|number| number as f64).collect();
    let unknowns: Vec<[usize; 3]> =
        assembly.unknowns.nodal_displacement(&numbers).into_iter().map(|node| node.map(|u| u as usize)).collect();
    let mut coarse: Vec<Option<u32>> = vec![None; n + 1];
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
    let mut weights = Vec::new();
    let mut is_done = vec![false; n];
    for nodes in mesh.elements() {
        for (node, place) in nodes.iter().zip(&HEXAHEDRON27_REFERENCE_NODES) {
            for component in 0..3 {
                let unknown = unknowns[*node as usize][component];
                if unknown == 0 || std::mem::replace(&mut is_done[unknown - 1], true) {
                    continue;
                }
                for (corner, at) in corners(nodes).into_iter().zip(&HEXAHEDRON27_REFERENCE_NODES) {
                    let weight: f64 = (0..3).map(|d| 0.5 * (1.0 + at[d] * place[d])).product();
                    if let Some(column) = coarse[unknowns[corner][component]].filter(|_| weight > 0.0) {
                        // Corners on the robot share an unknown, so their weights add up.
                        weights.push(Triplet::new(unknown as u32 - 1, column, weight));
                    }
                }
            }
        }
    }
    Matrix::try_new_from_triplets(n, n_coarse as usize, &weights).map_err(|error| refused(format!("{error:?}")))
}

/// Two-grid preconditioner.
struct TwoGrids<'a> {
    fine: &'a Matrix,
    /// Prolongation from the coarse grid to the fine one.
    up: &'a Matrix,
    /// Transpose of the prolongation.
    down: Matrix,
    coarse: Llt<u32, f64>,
}

impl<'a> TwoGrids<'a> {
    /// Projects the fine matrix onto the coarse grid, and factorises the projection.
    fn new(fine: &'a Matrix, up: &'a Matrix) -> Result<Self> {
        let down = up.transpose().to_col_major().map_err(|error| refused(format!("{error:?}")))?;
        let projected = &down * &(fine * up);
        let symbolic =
            SymbolicLlt::try_new(projected.symbolic(), Side::Lower).map_err(|error| refused(format!("{error:?}")))?;
        let coarse = Llt::try_new_with_symbolic(symbolic, projected.as_ref(), Side::Lower)
            .map_err(|error| refused(format!("the coarse grid is not positive definite: {error:?}")))?;
        Ok(Self { fine, up, down, coarse })
    }

    fn n_coarse(&self) -> usize {
        self.up.ncols()
    }

    /// Applies the preconditioner: a sweep, the coarse grid's correction, and the reversed sweep. The operation is symmetric and positive definite.
    fn apply(&self, residual: &[f64]) -> Vec<f64> {
        let n = residual.len();
        let mut x = vec![0.0; n];
        sweep(self.fine, 0..n, residual, &mut x);
        let left: Vec<f64> = residual.iter().zip(products(self.fine, &x)).map(|(r, ax)| r - ax).collect();
        let mut correction = products(self.up, &left);
        let column = MatMut::from_column_major_slice_mut(&mut correction, self.n_coarse(), 1);
        self.coarse.solve_in_place_with_conj(faer::Conj::No, column);
        x.iter_mut().zip(products(&self.down, &correction)).for_each(|(x, c)| *x += c);
        sweep(self.fine, (0..n).rev(), residual, &mut x);
        x
    }
}

/// Solves by conjugate gradients from 0. Returns the solution and the number of iterations.
fn solve(matrix: &Matrix, grids: &TwoGrids, force: &[f64]) -> Result<(Vec<f64>, usize)> {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let mut x = vec![0.0; force.len()];
    let mut residual = force.to_vec();
    let mut z = grids.apply(&residual);
    let mut direction = z.clone();
    let mut rho = dot(&residual, &z);
    let goal = TOLERANCE * dot(force, force).sqrt();
    for iteration in 1..=MOST_ITERATIONS {
        let image = products(matrix, &direction);
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
    Err(refused(format!("{MOST_ITERATIONS} iterations were too few")))
}
