//! Unknowns of the half meridian, condensation of the cells' interiors, and sparse solution.

use std::collections::HashMap;

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::sparse::linalg::cholesky::{self, CholeskySymbolicParams, LltRef, SymmetricOrdering};
use faer::sparse::{SparseColMat, Triplet};
use faer::{Conj, Mat, MatMut, Par, Side};
use rayon::prelude::*;

use super::element::{self, Mode, ShapeTable};
use super::mesh::{Boundary, Cell, Mesh};
use super::{Direction, Formulation};
use base::error::{Error, Result};

/// One displacement component of one node. It is a multiple of an unknown, or of the body's unit
/// translation.
#[derive(Debug, Clone, Copy)]
pub(super) struct Freedom {
    pub(super) unknown: Option<usize>,
    pub factor: f64,
}

/// Stiffnesses (m) of the whole body, per Pa of Young's modulus, computed with one discretisation.
#[derive(Debug, Clone, Copy)]
pub(super) struct Discrete {
    pub(super) by_energy_m: f64,
    pub(super) by_reaction_m: f64,
    pub(super) n_unknowns: usize,
}

/// Numbering of the nodes on the edges of the cells.
pub(in crate::fe) struct Skeleton {
    order: usize,
    pub(in crate::fe) boundaries: Vec<Boundary>,
    /// Index of the first inner node of each edge, by its two vertices. The nodes run from the
    /// vertex with the lower index.
    edges: HashMap<[usize; 2], usize>,
}

impl Skeleton {
    pub fn new(mesh: &Mesh, order: usize) -> Self {
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

    /// Index of the node that is `k` steps along the edge from vertex `a` to vertex `b`.
    fn on_edge(&self, [a, b]: [usize; 2], k: usize) -> usize {
        match k {
            0 => a,
            k if k == self.order => b,
            _ if a == b => a,
            k if a < b => self.edges[&[a, b]] + k - 1,
            k => self.edges[&[b, a]] + self.order - 1 - k,
        }
    }

    /// Node of each shape function of a cell; `None` for functions of its interior.
    pub(in crate::fe) fn nodes(&self, cell: &Cell) -> Vec<Option<usize>> {
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

/// The four edges of a cell as pairs of vertices: inner curve, outer curve, across at the curves'
/// start, across at their end.
pub(super) fn edges_of(cell: &Cell) -> [[usize; 2]; 4] {
    let [a, b, c, d] = cell.vertices;
    [[a, b], [c, d], [a, c], [b, d]]
}

/// Unit translation of the body as components (U, W) or (U, V, W) of the mode.
pub(super) fn translation(direction: Direction) -> &'static [f64] {
    match direction {
        Direction::Axial => &[0.0, 1.0],
        // The translation is x = cos θ e_r − sin θ e_θ, so that U = 1 and V = −1.
        Direction::Transverse => &[1.0, -1.0, 0.0],
    }
}

/// Numbers the unknowns and returns the freedom of every component of every node.
///
/// n is the number of the Fourier mode; U, V and W are its components along r, θ and z. On the axis
/// a smooth field has U = 0 for n = 0. For n = 1, where it is a horizontal vector, it has U + V = 0
/// and W = 0. An axial translation makes W even and U odd about the plane z = 0. A transverse
/// translation makes U and V even and W odd.
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

/// Stiffness of a cell between the shape functions on its edges, after elimination of its interior.
pub(super) struct Condensed {
    pub(super) nodes: Vec<usize>,
    /// Full matrix, both triangles. Rows and columns are ordered component by component.
    pub(super) stiffness: Mat<f64>,
    /// Load on the functions of the edges.
    pub(super) load: Vec<f64>,
    /// Contribution of the eliminated interior to load · displacement.
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

/// Rigid motion of the body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Motion {
    /// Unit translation along the direction of the force.
    Translation,
    /// Unit rotation about a line at this height on the axis. The line is perpendicular to the axis
    /// and to the translation. Mode 1 only.
    Rotation { height_m: f64 },
}

/// Condensed cells and numbered unknowns of a problem, independent of the body's motion.
pub(super) struct Assembled<'a> {
    mesh: &'a Mesh,
    table: &'a ShapeTable,
    direction: Direction,
    boundaries: Vec<Boundary>,
    freedoms: Vec<Vec<Freedom>>,
    cells: Vec<Condensed>,
    triplets: Vec<Triplet<u32, u32, f64>>,
    n_skeleton: usize,
    /// Integral of cos² nθ over the full circle, with the number n of the Fourier mode; doubled if
    /// only one half is meshed.
    whole: f64,
    n_components: usize,
}

/// Displacements of a solution on the edges of every cell, component by component.
pub(super) struct Response(Vec<Vec<f64>>);

impl<'a> Assembled<'a> {
    pub fn new(
        mesh: &'a Mesh,
        table: &'a ShapeTable,
        direction: Direction,
        poisson_ratio: f64,
        formulation: Formulation,
    ) -> Result<Self> {
        let mode = Mode::of(direction);
        let skeleton = Skeleton::new(mesh, table.order);
        let (freedoms, n_skeleton) = freedoms(&skeleton.boundaries, direction, true);
        let condensed = |cell: &Cell| {
            let stiffness = table.stiffness(&cell.map, &mode, poisson_ratio, formulation)?;
            condense(&stiffness, &vec![0.0; stiffness.nrows()], &skeleton.nodes(cell), mode.n_components)
        };
        let cells: Vec<Condensed> = mesh.cells.par_iter().map(condensed).collect::<Result<_>>()?;
        let halves = if mesh.is_whole { 1.0 } else { 2.0 };
        let mut assembled = Self {
            mesh,
            table,
            direction,
            boundaries: skeleton.boundaries,
            freedoms,
            cells,
            triplets: Vec::new(),
            n_skeleton,
            whole: halves * mode.circle,
            n_components: mode.n_components,
        };
        let mut triplets = Vec::new();
        for cell in &assembled.cells {
            let local = assembled.local(cell);
            for (b, column) in local.iter().enumerate() {
                for (row, entry) in local.iter().zip(cell.stiffness.col_as_slice(b)) {
                    if let (Some(i), Some(j)) = (row.unknown, column.unknown)
                        && i >= j
                    {
                        triplets.push(Triplet::new(i as u32, j as u32, row.factor * column.factor * entry));
                    }
                }
            }
        }
        assembled.triplets = triplets;
        Ok(assembled)
    }

    pub(super) fn n_unknowns(&self) -> usize {
        self.n_skeleton + self.mesh.cells.len() * (self.table.order - 1).pow(2) * self.n_components
    }

    fn local(&self, cell: &Condensed) -> Vec<Freedom> {
        (0..self.n_components)
            .flat_map(|c| cell.nodes.iter().map(move |&node| (node, c)))
            .map(|(node, c)| self.freedoms[node][c])
            .collect()
    }

    /// Displacements that the body's motion prescribes on the edges of cell `index`, component by
    /// component. Entries at unknowns are meaningless.
    fn prescribed(&self, index: usize, motion: Motion) -> Vec<f64> {
        let cell = &self.cells[index];
        let Motion::Rotation { height_m } = motion else {
            return self.local(cell).iter().map(|freedom| freedom.factor).collect();
        };
        let (map, nodes, last) = (&self.mesh.cells[index].map, &self.table.nodes, self.table.order);
        let is_edge = |i: usize, j: usize| [0, last].contains(&i) || [0, last].contains(&j);
        let places = (0..=last).flat_map(|j| (0..=last).map(move |i| (i, j))).filter(|(i, j)| is_edge(*i, *j));
        let places: Vec<[f64; 2]> = places.map(|(i, j)| map.at(nodes[i], nodes[j]).0).collect();
        // The rotation is u = ŷ × (x, y, z − h) = (z − h) x̂ − x ẑ, so that U = −V = z − h and
        // W = −r.
        let of = |component: usize, [r, z]: [f64; 2]| [z - height_m, height_m - z, -r][component];
        (0..self.n_components)
            .flat_map(|c| cell.nodes.iter().zip(&places).map(move |(node, place)| (c, *node, *place)))
            .map(|(c, node, place)| if self.boundaries[node].outer { 0.0 } else { of(c, place) })
            .collect()
    }

    pub(super) fn respond(&self, motion: Motion) -> Result<Response> {
        let mut right_hand_side = vec![0.0; self.n_skeleton];
        for (index, cell) in self.cells.iter().enumerate() {
            let (local, given) = (self.local(cell), self.prescribed(index, motion));
            for (b, value) in given.iter().enumerate().filter(|(b, _)| local[*b].unknown.is_none()) {
                for (row, entry) in local.iter().zip(cell.stiffness.col_as_slice(b)) {
                    if let Some(i) = row.unknown {
                        right_hand_side[i] -= row.factor * value * entry;
                    }
                }
            }
        }
        let solution = solve_sparse(self.n_skeleton, &self.triplets, right_hand_side)?;
        let of_cell = |(index, cell): (usize, &Condensed)| {
            let given = self.prescribed(index, motion);
            let value =
                |(freedom, given): (&Freedom, &f64)| freedom.unknown.map_or(*given, |u| freedom.factor * solution[u]);
            self.local(cell).iter().zip(&given).map(value).collect()
        };
        Ok(Response(self.cells.iter().enumerate().map(of_cell).collect()))
    }

    /// Work of the forces of one response on the displacements of another, for the whole body.
    pub(super) fn energy(&self, one: &Response, other: &Response) -> f64 {
        let mut energy = 0.0;
        for ((cell, one), other) in self.cells.iter().zip(&one.0).zip(&other.0) {
            for (a, u) in one.iter().enumerate() {
                let force: f64 = other.iter().zip(cell.stiffness.col_as_slice(a)).map(|(u, k)| k * u).sum();
                energy += u * force;
            }
        }
        self.whole * energy
    }

    /// Force on the outer sphere along the translation.
    pub(super) fn reaction(&self, response: &Response) -> f64 {
        let translation = translation(self.direction);
        let mut reaction = 0.0;
        for (cell, values) in self.cells.iter().zip(&response.0) {
            for a in 0..values.len() {
                if self.boundaries[cell.nodes[a % cell.nodes.len()]].outer {
                    let force: f64 = values.iter().zip(cell.stiffness.col_as_slice(a)).map(|(u, k)| k * u).sum();
                    reaction -= translation[a / cell.nodes.len()] * force;
                }
            }
        }
        self.whole * reaction
    }
}

/// Computes the gel's stiffness against a translation of the body.
pub(super) fn solve(
    mesh: &Mesh,
    table: &ShapeTable,
    direction: Direction,
    poisson_ratio: f64,
    formulation: Formulation,
) -> Result<Discrete> {
    let assembled = Assembled::new(mesh, table, direction, poisson_ratio, formulation)?;
    let response = assembled.respond(Motion::Translation)?;
    Ok(Discrete {
        by_energy_m: assembled.energy(&response, &response),
        by_reaction_m: assembled.reaction(&response),
        n_unknowns: assembled.n_unknowns(),
    })
}

/// Solves a positive definite system given by its lower triangle. One thread is used, so that
/// results are equal to the bit for any number of threads.
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
    .map_err(|e| failed(format!("cannot be factorised symbolically: {e:?}")))?;
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
