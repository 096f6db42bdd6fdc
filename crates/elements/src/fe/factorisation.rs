//! Sparse Cholesky factorisation of the stiffness matrix at unit Young's modulus.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::sparse::linalg::cholesky::{self, CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering};
use faer::sparse::{SparseColMat, SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side};

use super::assembly::Assembly;
use super::ordering::nested_dissection;
use crate::mesh::Mesh;
use base::error::{Error, Result};

/// Stiffness matrix of a mesh for unit Young's modulus, with its symbolic Cholesky factor. All
/// Poisson ratios share the symbolic factor.
#[derive(Debug)]
pub struct Stiffness {
    /// Deviatoric and volumetric parts of the matrix, and the numbering of the unknowns.
    pub assembly: Assembly,
    symbolic: SymbolicCholesky<u32>,
}

impl Stiffness {
    /// Assembles the stiffness of a mesh, orders the nodes by nested dissection and computes the
    /// symbolic factor.
    pub fn new(mesh: &Mesh) -> Result<Self> {
        let assembly = Assembly::new(mesh)?;
        let n_nodes_per_element = mesh.element_kind.n_nodes();
        let node_order =
            nested_dissection(mesh.n_nodes(), &mesh.connectivity, n_nodes_per_element, &mesh.node_coordinates_m);
        let order = assembly.unknowns.elimination_order(&node_order);
        let symbolic = analysed(assembly.deviatoric().symbolic(), &order)?;
        Ok(Self { assembly, symbolic })
    }

    /// Number of displacement unknowns.
    pub fn n_unknowns(&self) -> usize {
        self.assembly.unknowns.count()
    }

    /// Computes the stiffness matrix at a Poisson ratio, for unit Young's modulus, and its Cholesky
    /// factor.
    pub fn factor(&self, poisson_ratio: f64) -> Result<Factor<'_>> {
        let matrix = self.assembly.unit_stiffness(poisson_ratio);
        let values = factorised(&self.symbolic, matrix.as_ref()).ok_or_else(|| {
            Error::numerical(
                format!("the stiffness at Poisson ratio {poisson_ratio} is not positive definite"),
                "check the mesh's symmetry planes and the Poisson ratio, which must lie in (−1, 0.5)",
            )
        })?;
        Ok(Factor { matrix, symbolic: &self.symbolic, values })
    }
}

/// Computes the symbolic Cholesky factor of a symmetric sparsity pattern (upper triangle) for an
/// elimination order of the unknowns.
pub(crate) fn analysed(
    upper: SymbolicSparseColMatRef<'_, u32>,
    elimination_order: &[usize],
) -> Result<SymbolicCholesky<u32>> {
    let forward: Vec<u32> = elimination_order.iter().map(|&u| u as u32).collect();
    let mut inverse = vec![0; forward.len()];
    for (position, &unknown) in forward.iter().enumerate() {
        inverse[unknown as usize] = position as u32;
    }
    let permutation = faer::perm::PermRef::new_checked(&forward, &inverse, forward.len());
    cholesky::factorize_symbolic_cholesky(
        upper,
        Side::Upper,
        SymmetricOrdering::Custom(permutation),
        CholeskySymbolicParams::default(),
    )
    .map_err(|e| {
        Error::numerical(
            format!("the symbolic Cholesky factorisation of {} unknowns failed: {e:?}", forward.len()),
            "use a coarser mesh",
        )
    })
}

/// Computes the values of the Cholesky factor of a matrix whose pattern `symbolic` describes.
/// Returns `None` if the matrix is not positive definite.
pub(crate) fn factorised(symbolic: &SymbolicCholesky<u32>, upper: SparseColMatRef<'_, u32, f64>) -> Option<Vec<f64>> {
    let mut values = vec![0.0; symbolic.len_val()];
    let mut memory = MemBuffer::new(symbolic.factorize_numeric_llt_scratch::<f64>(PARALLELISM, Default::default()));
    let outcome = symbolic.factorize_numeric_llt(
        &mut values,
        upper,
        Side::Upper,
        LltRegularization::default(),
        PARALLELISM,
        MemStack::new(&mut memory),
        Default::default(),
    );
    outcome.is_ok().then_some(values)
}

/// Solves A x = b for every column b of `columns` and replaces b by x. `symbolic` and `values` are
/// the Cholesky factor of A. `columns` holds one value per unknown, column after column.
pub(crate) fn solve_in_place(symbolic: &SymbolicCholesky<u32>, values: &[f64], columns: &mut [f64]) {
    let n = symbolic.nrows();
    let n_columns = columns.len() / n;
    let right_hand_sides = MatMut::from_column_major_slice_mut(columns, n, n_columns);
    let mut memory = MemBuffer::new(symbolic.solve_in_place_scratch::<f64>(n_columns, PARALLELISM));
    LltRef::<'_, u32, f64>::new(symbolic, values).solve_in_place_with_conj(
        Conj::No,
        right_hand_sides,
        PARALLELISM,
        MemStack::new(&mut memory),
    );
}

/// Number of threads of the factorisation: one, because the last bits of a parallel factor depend
/// on the number of threads.
const PARALLELISM: Par = Par::Seq;

/// Stiffness matrix at one Poisson ratio, for unit Young's modulus, with its Cholesky factor.
pub struct Factor<'a> {
    matrix: SparseColMat<u32, f64>,
    symbolic: &'a SymbolicCholesky<u32>,
    values: Vec<f64>,
}

impl Factor<'_> {
    /// Number of displacement unknowns.
    pub fn n_unknowns(&self) -> usize {
        self.matrix.nrows()
    }

    /// Upper triangle of the stiffness matrix for unit Young's modulus.
    pub fn matrix(&self) -> SparseColMatRef<'_, u32, f64> {
        self.matrix.as_ref()
    }

    /// Replaces every column of forces in `columns` by the displacements that they cause at unit
    /// Young's modulus. `columns` holds `n_unknowns` values per column, column after column.
    pub fn solve_in_place(&self, columns: &mut [f64]) {
        solve_in_place(self.symbolic, &self.values, columns);
    }

    /// Displacements (m) at unit Young's modulus for a unit force on the part of the robot in the
    /// mesh. In a mesh with symmetry planes, this part bears only the fraction [`Mesh::share`] of
    /// the force on the whole robot.
    pub fn unit_response(&self) -> Vec<f64> {
        let mut field = vec![0.0; self.n_unknowns()];
        if let Some(last) = field.last_mut() {
            *last = 1.0;
        }
        self.solve_in_place(&mut field);
        field
    }
}

/// Adds the product A x to `result`. `upper` is the upper triangle of the symmetric matrix A.
pub fn add_symmetric_product(upper: SparseColMatRef<'_, u32, f64>, x: &[f64], result: &mut [f64]) {
    let (column_start, row_idx, values) = (upper.col_ptr(), upper.row_idx(), upper.val());
    for column in 0..upper.ncols() {
        let range = column_start[column] as usize..column_start[column + 1] as usize;
        let mut sum = 0.0;
        for (&row, &value) in row_idx[range.clone()].iter().zip(&values[range]) {
            let row = row as usize;
            sum += value * x[row];
            if row != column {
                result[row] += value * x[column];
            }
        }
        result[column] += sum;
    }
}
