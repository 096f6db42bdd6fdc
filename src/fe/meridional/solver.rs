//! Unknowns, static condensation of the cells' interiors, and the sparse solution.

use std::collections::HashMap;

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::sparse::linalg::cholesky::{self, CholeskySymbolicParams, LltRef, SymmetricOrdering};
use faer::sparse::{SparseColMat, Triplet};
use faer::{Conj, Mat, MatMut, Par, Side};
use rayon::prelude::*;

use super::element::{self, Mode, Table};
use super::mesh::{Boundary, Cell, Mesh};
use super::{Direction, Formulation};
use crate::error::{Error, Result};

/// One displacement component of one node: a multiple of an unknown, or of the body's unit translation.
#[derive(Debug, Clone, Copy)]
pub(super) struct Freedom {
    pub(super) unknown: Option<usize>,
    pub(super) factor: f64,
}

/// Stiffnesses that one discretisation gives: of the whole body, per Pa of Young's modulus, in m.
#[derive(Debug, Clone, Copy)]
pub(super) struct Discrete {
    pub(super) by_energy_m: f64,
    pub(super) by_reaction_m: f64,
    pub(super) n_unknowns: usize,
}

/// Nodes on the edges of the cells.
pub(super) struct Skeleton {
    order: usize,
    pub(super) boundaries: Vec<Boundary>,
    /// First of the inner nodes of each edge, which run from the vertex of the lower index.
    edges: HashMap<[usize; 2], usize>,
}

impl Skeleton {
    pub(super) fn new(mesh: &Mesh, order: usize) -> Self {
        let (mut boundaries, mut edges) = (mesh.boundaries.clone(), HashMap::new());
        for cell in &mesh.cells {
            for [a, b] in edges_of(cell) {
                if a != b {
                    edges.entry([a.min(b), a.max(b)]).or_insert_with(|| {
                        let first = boundaries.len();
                        let edge = mesh.boundaries[a].and(mesh.boundaries[b]);
                        boundaries.resize(first + order - 1, edge);
                        first
                    });
                }
            }
        }
        Self { order, boundaries, edges }
    }

    /// Node `k` steps along the edge from vertex `a` to vertex `b`.
    fn on_edge(&self, [a, b]: [usize; 2], k: usize) -> usize {
        match k {
            0 => a,
            k if k == self.order => b,
            _ if a == b => a,
            k if a < b => self.edges[&[a, b]] + k - 1,
            k => self.edges[&[b, a]] + self.order - 1 - k,
        }
    }

    /// Node of each function of a cell, or `None` for its interior.
    pub(super) fn nodes(&self, cell: &Cell) -> Vec<Option<usize>> {
        let [bottom, top, left, right] = edges_of(cell);
        let last = self.order;
        let node = |i: usize, j: usize| match (i, j) {
            (i, 0) => Some(self.on_edge(bottom, i)),
            (i, j) if j == last => Some(self.on_edge(top, i)),
            (0, j) => Some(self.on_edge(left, j)),
            (i, j) if i == last => Some(self.on_edge(right, j)),
            _ => None,
        };
        (0..=last).flat_map(|j| (0..=last).map(move |i| (i, j))).map(|(i, j)| node(i, j)).collect()
    }
}

/// Edges of a cell: along the inner curve, along the outer, across at the start, across at the end.
pub(super) fn edges_of(cell: &Cell) -> [[usize; 2]; 4] {
    let [a, b, c, d] = cell.vertices;
    [[a, b], [c, d], [a, c], [b, d]]
}

/// The body's translation, by component of the mode.
pub(super) fn translation(direction: Direction) -> &'static [f64] {
    match direction {
        Direction::Axial => &[0.0, 1.0],
        // x = cos θ e_r − sin θ e_θ.
        Direction::Transverse => &[1.0, -1.0, 0.0],
    }
}

/// Components of every node.
///
/// On the axis a smooth field has U = 0 for n = 0, and U + V = 0 and W = 0 for n = 1 (a horizontal vector there). Across the plane z = 0 an axial
/// translation makes W even and U odd, a transverse one U and V even and W odd.
pub(super) fn freedoms(boundaries: &[Boundary], direction: Direction, is_rigid: bool) -> (Vec<Vec<Freedom>>, usize) {
    let mut count = 0;
    let mut unknown = |is_free: bool| {
        if !is_free {
            return Freedom { unknown: None, factor: 0.0 };
        }
        count += 1;
        Freedom { unknown: Some(count - 1), factor: 1.0 }
    };
    let of_node = |boundary: &Boundary| -> Vec<Freedom> {
        if boundary.outer || (boundary.body && is_rigid) {
            let factor = if boundary.outer { 0.0 } else { 1.0 };
            return translation(direction).iter().map(|t| Freedom { unknown: None, factor: factor * t }).collect();
        }
        match direction {
            Direction::Axial => vec![unknown(!boundary.axis && !boundary.equator), unknown(true)],
            Direction::Transverse if boundary.axis => {
                let u = unknown(true);
                vec![u, Freedom { factor: -1.0, ..u }, unknown(false)]
            }
            Direction::Transverse => vec![unknown(true), unknown(true), unknown(!boundary.equator)],
        }
    };
    (boundaries.iter().map(of_node).collect(), count)
}

/// A cell's stiffness between the functions on its edges, the interior condensed.
pub(super) struct Condensed {
    pub(super) nodes: Vec<usize>,
    /// Component by component; both triangles.
    pub(super) stiffness: Mat<f64>,
    /// Load on the same, and what the condensed interior adds to load · displacement.
    pub(super) load: Vec<f64>,
    pub(super) work: f64,
}

pub(super) fn condense(
    stiffness: &Mat<f64>,
    load: &[f64],
    nodes: &[Option<usize>],
    n_components: usize,
) -> Result<Condensed> {
    let n = nodes.len();
    let split = |on_edge: bool| -> Vec<usize> {
        (0..n_components)
            .flat_map(|c| (0..n).filter(|&a| nodes[a].is_some() == on_edge).map(move |a| c * n + a))
            .collect()
    };
    let (interior, edge) = (split(false), split(true));
    let entry = |a: usize, b: usize| if a >= b { stiffness[(a, b)] } else { stiffness[(b, a)] };
    let mut inner = Mat::from_fn(interior.len(), interior.len(), |a, b| entry(interior[a], interior[b]));
    let mut coupling = Mat::from_fn(interior.len(), edge.len(), |a, b| entry(interior[a], edge[b]));
    let mut condensed = Mat::from_fn(edge.len(), edge.len(), |a, b| entry(edge[a], edge[b]));
    element::cholesky(inner.as_mut())?;
    solve_lower_triangular_in_place(inner.as_ref(), coupling.as_mut(), Par::Seq);
    let mut inner_load = Mat::from_fn(interior.len(), 1, |a, _| load[interior[a]]);
    solve_lower_triangular_in_place(inner.as_ref(), inner_load.as_mut(), Par::Seq);
    let inner_load = inner_load.col_as_slice(0);
    let product = |b: usize| -> f64 { coupling.col_as_slice(b).iter().zip(inner_load).map(|(c, f)| c * f).sum() };
    let load = edge.iter().enumerate().map(|(b, place)| load[*place] - product(b)).collect();
    let work = inner_load.iter().map(|f| f * f).sum();
    element::add_lower_gram(condensed.as_mut(), coupling.as_ref(), -1.0);
    for b in 0..edge.len() {
        for a in 0..b {
            condensed[(a, b)] = condensed[(b, a)];
        }
    }
    Ok(Condensed { nodes: nodes.iter().flatten().copied().collect(), stiffness: condensed, load, work })
}

/// Solves for the unit translation of the body.
pub(super) fn solve(
    mesh: &Mesh,
    table: &Table,
    direction: Direction,
    poisson_ratio: f64,
    formulation: Formulation,
) -> Result<Discrete> {
    let mode = Mode::of(direction);
    let skeleton = Skeleton::new(mesh, table.order);
    let (freedoms, n_skeleton) = freedoms(&skeleton.boundaries, direction, true);
    let condensed = |cell: &Cell| {
        let stiffness = table.stiffness(&cell.map, &mode, poisson_ratio, formulation)?;
        condense(&stiffness, &vec![0.0; stiffness.nrows()], &skeleton.nodes(cell), mode.n_components)
    };
    let cells: Vec<Condensed> = mesh.cells.par_iter().map(condensed).collect::<Result<_>>()?;
    let local = |cell: &Condensed| -> Vec<Freedom> {
        (0..mode.n_components)
            .flat_map(|c| cell.nodes.iter().map(move |&node| (node, c)))
            .map(|(node, c)| freedoms[node][c])
            .collect()
    };

    let mut right_hand_side = vec![0.0; n_skeleton];
    let mut triplets = Vec::new();
    for cell in &cells {
        let local = local(cell);
        for (b, column) in local.iter().enumerate() {
            for (row, entry) in local.iter().zip(cell.stiffness.col_as_slice(b)) {
                let value = row.factor * column.factor * entry;
                match (row.unknown, column.unknown) {
                    (Some(i), Some(j)) if i >= j => triplets.push(Triplet::new(i as u32, j as u32, value)),
                    (Some(i), None) => right_hand_side[i] -= value,
                    _ => {}
                }
            }
        }
    }
    let solution = solve_sparse(n_skeleton, &triplets, right_hand_side)?;

    let translation = translation(direction);
    let (mut energy, mut reaction) = (0.0, 0.0);
    for cell in &cells {
        let displacement: Vec<f64> =
            local(cell).iter().map(|f| f.factor * f.unknown.map_or(1.0, |u| solution[u])).collect();
        for a in 0..displacement.len() {
            let force: f64 = displacement.iter().zip(cell.stiffness.col_as_slice(a)).map(|(u, k)| k * u).sum();
            energy += displacement[a] * force;
            if skeleton.boundaries[cell.nodes[a % cell.nodes.len()]].outer {
                reaction -= translation[a / cell.nodes.len()] * force;
            }
        }
    }
    let n_interior = mesh.cells.len() * (table.order - 1).pow(2) * mode.n_components;
    // Both halves of the body.
    let whole = 2.0 * mode.circle;
    Ok(Discrete { by_energy_m: whole * energy, by_reaction_m: whole * reaction, n_unknowns: n_skeleton + n_interior })
}

/// Solves a positive definite system given by its lower triangle; one thread, so that the result is the same bytes for any number.
pub(super) fn solve_sparse(
    n: usize,
    triplets: &[Triplet<u32, u32, f64>],
    mut right_hand_side: Vec<f64>,
) -> Result<Vec<f64>> {
    let failed = |what: String| {
        Error::numerical(
            format!("the meridional stiffness of {n} unknowns {what}"),
            "use a lower order or a Poisson ratio further from ½",
        )
    };
    let matrix = SparseColMat::<u32, f64>::try_new_from_triplets(n, n, triplets)
        .map_err(|e| failed(format!("cannot be assembled: {e:?}")))?;
    let symbolic = cholesky::factorize_symbolic_cholesky(
        matrix.symbolic(),
        Side::Lower,
        SymmetricOrdering::Amd,
        CholeskySymbolicParams::default(),
    )
    .map_err(|e| failed(format!("cannot be analysed: {e:?}")))?;
    let mut values = vec![0.0; symbolic.len_val()];
    let mut memory = MemBuffer::new(symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default()));
    symbolic
        .factorize_numeric_llt(
            &mut values,
            matrix.as_ref(),
            Side::Lower,
            LltRegularization::default(),
            Par::Seq,
            MemStack::new(&mut memory),
            Default::default(),
        )
        .map_err(|e| failed(format!("is not positive definite: {e:?}")))?;
    let mut memory = MemBuffer::new(symbolic.solve_in_place_scratch::<f64>(1, Par::Seq));
    LltRef::<'_, u32, f64>::new(&symbolic, &values).solve_in_place_with_conj(
        Conj::No,
        MatMut::from_column_major_slice_mut(&mut right_hand_side, n, 1),
        Par::Seq,
        MemStack::new(&mut memory),
    );
    Ok(right_hand_side)
}
