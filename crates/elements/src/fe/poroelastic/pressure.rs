//! Continuous linear pressures, given at the corners of the elements, and their matrices.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::sparse::linalg::cholesky::{self, CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMat};
use faer::{Conj, MatMut, Par, Side};
use rayon::prelude::*;

use crate::fe::Unknowns;
use crate::fe::element::TabulatedElement;
use crate::fe::factorisation::add_symmetric_product;
use crate::mesh::{ElementKind, HEXAHEDRON27_REFERENCE_NODES, Mesh};
use base::error::{Error, Result};

/// Pore pressures of a mesh, with three matrices for pressure functions q and displacements u. They
/// are the divergence matrix ∫ q div u, the mass matrix ∫ q q and the diffusion matrix ∫ ∇q·∇q. No
/// pressure is fixed, because robot, outer wall and symmetry planes are impermeable.
#[derive(Debug)]
pub struct PressureSpace {
    nodes: Vec<u32>,
    n_displacements: usize,
    /// Index of the first entry of each pressure's row of the divergence matrix.
    row_start: Vec<usize>,
    /// Entries of the divergence matrix, row by row: unknown and value (m²).
    entries: Vec<(u32, f64)>,
    /// Sparsity pattern of the upper triangles of the mass and diffusion matrices.
    pattern: SymbolicSparseColMat<u32>,
    mass: Vec<f64>,
    diffusion: Vec<f64>,
    symbolic: SymbolicCholesky<u32>,
}

/// Divergence, mass and diffusion matrices of one element, row by row. The divergence matrix has
/// one row per corner, with three entries per node.
struct ElementMatrices {
    divergence: Vec<[f64; 3]>,
    mass: Vec<f64>,
    diffusion: Vec<f64>,
}

impl PressureSpace {
    /// Assembles the matrices of a mesh of 27-node hexahedra or 10-node tetrahedra. `unknowns`
    /// numbers the displacements.
    ///
    /// # Errors
    /// [`Error::Numerical`] for inverted elements and for 4-node tetrahedra. With their linear
    /// displacements, linear pressures would oscillate.
    pub fn new(mesh: &Mesh, unknowns: &Unknowns) -> Result<Self> {
        let corner_values = corner_values(mesh.element_kind)?;
        let n_corners = corner_values.len();
        let (pressure_of, nodes) = numbered(mesh, n_corners);
        let table = TabulatedElement::of(mesh.element_kind);
        let elements: Vec<&[u32]> = mesh.elements().collect();
        let matrices = |nodes: &&[u32]| {
            let coordinates: Vec<_> = nodes.iter().map(|&n| mesh.node_coordinates_m[n as usize]).collect();
            element_matrices(table, &coordinates, &corner_values)
        };
        let matrices: Vec<ElementMatrices> = elements.par_iter().map(matrices).collect::<Result<_>>()?;

        // Index + 1 of the unknown of every node's component; 0 for fixed components.
        let count = unknowns.count();
        let places = unknowns.nodal_displacement(&(1..=count).map(|i| i as f64).collect::<Vec<_>>());
        let (mut divergence, mut symmetric) = (Vec::new(), Vec::new());
        for (element, of) in elements.iter().zip(&matrices) {
            let pressure = |a: usize| pressure_of[element[a] as usize];
            for a in 0..n_corners {
                for (&node, values) in element.iter().zip(&of.divergence[a * element.len()..]) {
                    let placed = places[node as usize].iter().zip(values).filter(|(place, _)| **place > 0.0);
                    divergence.extend(placed.map(|(place, value)| ((pressure(a), *place as u32 - 1), *value)));
                }
                for b in 0..n_corners {
                    if pressure(a) <= pressure(b) {
                        let at = a * n_corners + b;
                        symmetric.push(((pressure(b), pressure(a)), [of.mass[at], of.diffusion[at]]));
                    }
                }
            }
        }
        let divergence = summed(divergence, |sum, value| *sum += value);
        let symmetric = summed(symmetric, |sum, value| {
            sum[0] += value[0];
            sum[1] += value[1];
        });
        let starts = |keys: &mut dyn Iterator<Item = u32>| {
            let mut starts = vec![0; nodes.len() + 1];
            keys.for_each(|key| starts[key as usize + 1] += 1);
            (0..nodes.len()).for_each(|i| starts[i + 1] += starts[i]);
            starts
        };
        let row_start = starts(&mut divergence.iter().map(|(key, _)| key.0));
        let column_start = starts(&mut symmetric.iter().map(|(key, _)| key.0)).into_iter().map(|s| s as u32).collect();
        let rows = symmetric.iter().map(|(key, _)| key.1).collect();
        let pattern = SymbolicSparseColMat::new_checked(nodes.len(), nodes.len(), column_start, None, rows);
        let symbolic = cholesky::factorize_symbolic_cholesky(
            pattern.as_ref(),
            Side::Upper,
            SymmetricOrdering::Amd,
            CholeskySymbolicParams::default(),
        )
        .map_err(|e| {
            Error::numerical(format!("factorising {} pressures failed: {e:?}", nodes.len()), "use a coarser mesh")
        })?;
        Ok(Self {
            nodes,
            n_displacements: count,
            row_start,
            entries: divergence.into_iter().map(|((_, column), value)| (column, value)).collect(),
            mass: symmetric.iter().map(|(_, values)| values[0]).collect(),
            diffusion: symmetric.iter().map(|(_, values)| values[1]).collect(),
            pattern,
            symbolic,
        })
    }

    /// Number of pressure unknowns.
    pub fn n_pressures(&self) -> usize {
        self.nodes.len()
    }

    /// Node of the mesh at which each pressure is defined.
    pub fn nodes(&self) -> &[u32] {
        &self.nodes
    }

    /// Divergence matrix times displacements, in m² times the unit of the displacements.
    pub fn divergence(&self, displacements: &[f64]) -> Vec<f64> {
        let product = |range: &[usize]| {
            self.entries[range[0]..range[1]].iter().map(|(j, b)| b * displacements[*j as usize]).sum()
        };
        self.row_start.windows(2).map(product).collect()
    }

    /// Adds the transposed divergence matrix times pressures to `result`.
    pub fn add_transposed_divergence(&self, pressures: &[f64], result: &mut [f64]) {
        for (range, q) in self.row_start.windows(2).zip(pressures) {
            self.entries[range[0]..range[1]].iter().for_each(|(j, b)| result[*j as usize] += b * q);
        }
    }

    /// Upper triangle of the mass matrix, in m³.
    pub fn mass(&self) -> SparseColMatRef<'_, u32, f64> {
        SparseColMatRef::new(self.pattern.as_ref(), &self.mass)
    }

    /// Upper triangle of the diffusion matrix, in m.
    pub fn diffusion(&self) -> SparseColMatRef<'_, u32, f64> {
        SparseColMatRef::new(self.pattern.as_ref(), &self.diffusion)
    }

    pub(super) fn n_displacements(&self) -> usize {
        self.n_displacements
    }

    /// Cholesky factor of `storage` × mass matrix + `area` × diffusion matrix.
    pub(super) fn factor(&self, storage: f64, area: f64) -> Result<PressureFactor<'_>> {
        let values: Vec<f64> = self.mass.iter().zip(&self.diffusion).map(|(m, h)| storage * m + area * h).collect();
        let matrix = SparseColMatRef::new(self.pattern.as_ref(), &values);
        let mut factor = vec![0.0; self.symbolic.len_val()];
        let mut memory =
            MemBuffer::new(self.symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default()));
        self.symbolic
            .factorize_numeric_llt(
                &mut factor,
                matrix,
                Side::Upper,
                LltRegularization::default(),
                Par::Seq,
                MemStack::new(&mut memory),
                Default::default(),
            )
            .map_err(|e| {
                Error::numerical(
                    format!("the storage {storage:e} and area {area:e} give no positive definite matrix ({e:?})"),
                    "give a drained Poisson ratio below the undrained one",
                )
            })?;
        Ok(PressureFactor { symbolic: &self.symbolic, values: factor })
    }

    /// Adds (`storage` × mass matrix + `area` × diffusion matrix) × `pressures` to `result`.
    pub(super) fn add_product(&self, storage: f64, area: f64, pressures: &[f64], result: &mut [f64]) {
        for (factor, matrix) in [(storage, self.mass()), (area, self.diffusion())] {
            if factor != 0.0 {
                let scaled: Vec<f64> = pressures.iter().map(|q| factor * q).collect();
                add_symmetric_product(matrix, &scaled, result);
            }
        }
    }
}

/// Cholesky factor of a weighted sum of the mass and diffusion matrices.
pub(super) struct PressureFactor<'a> {
    symbolic: &'a SymbolicCholesky<u32>,
    values: Vec<f64>,
}

impl PressureFactor<'_> {
    pub(super) fn solve_in_place(&self, pressures: &mut [f64]) {
        let n = pressures.len();
        let mut memory = MemBuffer::new(self.symbolic.solve_in_place_scratch::<f64>(1, Par::Seq));
        LltRef::<'_, u32, f64>::new(self.symbolic, &self.values).solve_in_place_with_conj(
            Conj::No,
            MatMut::from_column_major_slice_mut(pressures, n, 1),
            Par::Seq,
            MemStack::new(&mut memory),
        );
    }
}

/// Values of each corner's linear function at all nodes of the element. They are the function's
/// coefficients in the element's own shape functions.
fn corner_values(kind: ElementKind) -> Result<Vec<Vec<f64>>> {
    match kind {
        ElementKind::Hexahedron27 => {
            let corners = &HEXAHEDRON27_REFERENCE_NODES[..8];
            let value = |corner: &[f64; 3], node: &[f64; 3]| -> f64 {
                corner.iter().zip(node).map(|(c, x)| 0.5 * (1.0 + c * x)).product()
            };
            let of_corner = |corner| HEXAHEDRON27_REFERENCE_NODES.iter().map(|node| value(corner, node)).collect();
            Ok(corners.iter().map(of_corner).collect())
        }
        ElementKind::Tetrahedron10 => {
            // The product 4 λₐλ_b is the shape function of the middle of edge ab. It vanishes at
            // the corners, and its coefficient in each end's linear function is ½.
            let table = TabulatedElement::of(kind);
            const EDGES: [[usize; 2]; 6] = [[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]];
            let value = |corner: usize, node: usize| match node.checked_sub(4) {
                None => f64::from(u8::from(node == corner)),
                Some(edge) => {
                    if EDGES[edge].contains(&corner) {
                        0.5
                    } else {
                        0.0
                    }
                }
            };
            Ok((0..4).map(|corner| (0..table.n_nodes).map(|node| value(corner, node)).collect()).collect())
        }
        ElementKind::Tetrahedron4 => Err(Error::numerical(
            "pore flow is not solved on 4-node tetrahedra: their linear displacements make pressures oscillate",
            "mesh with 10-node tetrahedra or 27-node hexahedra",
        )),
    }
}

/// Numbers the pressures in the order of the nodes. Returns the pressure of each node (`u32::MAX`
/// if it has none) and the node of each pressure.
fn numbered(mesh: &Mesh, n_corners: usize) -> (Vec<u32>, Vec<u32>) {
    let mut pressure_of = vec![u32::MAX; mesh.n_nodes()];
    mesh.elements().for_each(|nodes| nodes[..n_corners].iter().for_each(|&node| pressure_of[node as usize] = 0));
    let mut nodes = Vec::new();
    for (node, pressure) in pressure_of.iter_mut().enumerate().filter(|(_, pressure)| **pressure == 0) {
        *pressure = nodes.len() as u32;
        nodes.push(node as u32);
    }
    (pressure_of, nodes)
}

fn element_matrices(
    table: &TabulatedElement,
    coordinates_m: &[[f64; 3]],
    corner_values: &[Vec<f64>],
) -> Result<ElementMatrices> {
    let (n_nodes, n_corners) = (coordinates_m.len(), corner_values.len());
    let mut result = ElementMatrices {
        divergence: vec![[0.0; 3]; n_corners * n_nodes],
        mass: vec![0.0; n_corners * n_corners],
        diffusion: vec![0.0; n_corners * n_corners],
    };
    table.for_each_point(coordinates_m, |point| {
        let combined = |values: &Vec<f64>| {
            let value: f64 = values.iter().zip(point.shape).map(|(v, n)| v * n).sum();
            let mut gradient = [0.0; 3];
            for (v, g) in values.iter().zip(point.gradient) {
                gradient.iter_mut().zip(g).for_each(|(sum, g)| *sum += v * g);
            }
            (value, gradient)
        };
        let pressures: Vec<(f64, [f64; 3])> = corner_values.iter().map(combined).collect();
        for (a, (q, dq)) in pressures.iter().enumerate() {
            let weight = q * point.volume_m3;
            for (entry, g) in result.divergence[a * n_nodes..].iter_mut().zip(point.gradient) {
                entry.iter_mut().zip(g).for_each(|(sum, g)| *sum += weight * g);
            }
            for (b, (r, dr)) in pressures.iter().enumerate() {
                result.mass[a * n_corners + b] += weight * r;
                let product: f64 = dq.iter().zip(dr).map(|(x, y)| x * y).sum();
                result.diffusion[a * n_corners + b] += point.volume_m3 * product;
            }
        }
    })?;
    Ok(result)
}

/// Sorts entries by key, and adds entries of equal keys in their original order.
fn summed<T>(mut entries: Vec<((u32, u32), T)>, add: impl Fn(&mut T, T)) -> Vec<((u32, u32), T)> {
    entries.sort_by_key(|(key, _)| *key);
    let mut result: Vec<((u32, u32), T)> = Vec::with_capacity(entries.len() / 4);
    for (key, value) in entries {
        match result.last_mut() {
            Some((last, sum)) if *last == key => add(sum, value),
            _ => result.push((key, value)),
        }
    }
    result
}
