//! The gel at finite strains around a robot: the unknowns, the balance of forces, and its solution.
//!
//! Unknowns are displacements in robot radii and pressures in Pa. Displacements inside a cell, and
//! its pressures except their mean, are eliminated cell by cell (static condensation). One unknown
//! is the robot's displacement. If the gel keeps its volume, the last cell's mean pressure is set
//! to 0: a uniform pressure has no effect in a gel that is fixed all around.

use rayon::prelude::*;

use super::cell::{CellShape, Condensed, Reference};
use super::lu::{Pattern, SparseLu};
use super::point::{self, Gradient, PointConstants, StageLaw, Symmetric};
use crate::fe::meridional::mesh::Mesh;
use crate::fe::meridional::solver::Skeleton;
use base::error::{Error, Result};

/// Index of the robot's displacement among the unknowns.
pub(super) const BODY: usize = 0;
/// Largest change of a displacement, in robot radii, at which Newton's method has converged.
const TOLERANCE: f64 = 1e-7;
/// Ratio of successive changes in Newton's method above which the matrix is factorised again.
const SLOW: f64 = 0.2;
const MOST_ITERATIONS: usize = 40;

/// Resistance of a compressible gel to changes of volume.
#[derive(Debug, Clone, Copy)]
pub(super) struct VolumeResistance {
    /// Modulus of the resistance that depends only on the volume, divided by the shear modulus.
    pub(super) modulus_ratio: f64,
    /// True if the stress that follows from the conformation (the stretch of the polymer) resists
    /// only changes of shape. The volume then has a separate resistance.
    pub(super) is_apart: bool,
}

/// A mesh of the gel with numbered unknowns.
pub(super) struct FieldMesh {
    pub(super) reference: Reference,
    pub(super) cells: Vec<FieldCell>,
    /// Number of unknowns that remain after condensation.
    n_global: usize,
    pub(super) n_unknowns: usize,
    /// Resistance to changes of volume; `None` if the gel keeps its volume.
    pub(super) volume: Option<VolumeResistance>,
    /// True for each unknown that is a pressure.
    is_pressure: Vec<bool>,
    /// Positions of the cells' entries in the matrix of the remaining unknowns.
    pattern: Pattern,
}

/// A cell of the mesh. Its local values are the displacements, component by component, and then the
/// pressures.
pub(super) struct FieldCell {
    pub(super) shape: CellShape,
    /// Indices of the local values that static condensation eliminates.
    interior: Vec<usize>,
    /// Indices of the local values that remain after static condensation: displacements on the
    /// edges, and the mean pressure.
    edge: Vec<usize>,
    /// Index, among the unknowns of the mesh, of each local value; `None` if the value is fixed at
    /// 0.
    unknown: Vec<Option<usize>>,
}

impl FieldCell {
    /// Iterates over pairs of edge values that are both unknown. Each item holds the row and column
    /// in the cell's condensed matrix, and the indices of the two unknowns.
    fn places(&self) -> impl Iterator<Item = (usize, usize, [usize; 2])> {
        let known = |place: &usize| self.unknown[*place];
        let pairs = (0..self.edge.len()).flat_map(|b| (0..self.edge.len()).map(move |a| (a, b)));
        pairs.filter_map(move |(a, b)| Some((a, b, [known(&self.edge[a])?, known(&self.edge[b])?])))
    }
}

impl FieldMesh {
    /// Numbers the unknowns of a mesh that has both halves of the meridian. The mesh's unit of
    /// length is the robot's radius.
    pub fn new(mesh: &Mesh, order: usize, volume: Option<VolumeResistance>) -> Result<Self> {
        let reference = Reference::new(order);
        let skeleton = Skeleton::new(mesh, order);
        let mut is_pressure = vec![false];
        let mut add = |pressure: bool| {
            is_pressure.push(pressure);
            Some(is_pressure.len() - 1)
        };
        let mut freedoms: Vec<[Option<usize>; 2]> = Vec::with_capacity(skeleton.boundaries.len());
        for boundary in &skeleton.boundaries {
            freedoms.push(if boundary.outer {
                [None, None]
            } else if boundary.body {
                [None, Some(BODY)]
            } else {
                let across = if boundary.axis { None } else { add(false) };
                [across, add(false)]
            });
        }
        let n_cells = mesh.cells.len();
        let has_mean = |k: usize| k + 1 < n_cells || volume.is_some();
        let means: Vec<Option<usize>> = (0..n_cells).map(|k| if has_mean(k) { add(true) } else { None }).collect();
        let in_gel = freedoms.iter().flatten().filter(|unknown| unknown.is_some_and(|u| u != BODY)).count();
        let n_global = 1 + in_gel + means.iter().flatten().count();
        let (n, n_pressures) = (reference.n_functions(), reference.n_pressures());
        let shapes: Vec<CellShape> =
            mesh.cells.par_iter().map(|cell| CellShape::new(&reference, &cell.map)).collect::<Result<_>>()?;
        let mut cells = Vec::with_capacity(n_cells);
        for ((cell, shape), mean) in mesh.cells.iter().zip(shapes).zip(means) {
            let (mut interior, mut edge, mut unknown) = (Vec::new(), Vec::new(), Vec::new());
            let nodes = skeleton.nodes(cell);
            for component in [0, 1] {
                for (a, node) in nodes.iter().enumerate() {
                    if node.is_some() { &mut edge } else { &mut interior }.push(component * n + a);
                    unknown.push(node.map_or_else(|| add(false), |node| freedoms[node][component]));
                }
            }
            edge.push(2 * n);
            unknown.push(mean);
            interior.extend((1..n_pressures).map(|k| 2 * n + k));
            unknown.extend((1..n_pressures).map(|_| add(true)));
            cells.push(FieldCell { shape, interior, edge, unknown });
        }
        let places = cells.iter().flat_map(FieldCell::places).map(|(_, _, place)| place);
        let pattern = Pattern::new(n_global, places)?;
        Ok(Self { reference, cells, n_global, n_unknowns: is_pressure.len(), volume, is_pressure, pattern })
    }

    pub(super) fn is_pressure(&self, unknown: usize) -> bool {
        self.is_pressure[unknown]
    }

    /// Returns the displacements and the pressures of a cell for the unknowns `x`.
    fn local(&self, cell: &FieldCell, x: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let mut displacement: Vec<f64> = cell.unknown.iter().map(|unknown| unknown.map_or(0.0, |u| x[u])).collect();
        let pressures = displacement.split_off(2 * self.reference.n_functions());
        (displacement, pressures)
    }

    /// Deformation gradient at every integration point of a cell.
    pub(super) fn gradients(&self, cell: &FieldCell, x: &[f64]) -> Vec<Gradient> {
        cell.shape.gradients(&self.local(cell, x).0)
    }
}

/// Input of one Runge–Kutta stage of a time step: the force, the law, and the state at the start of
/// the stage.
pub(super) struct FieldStage<'a> {
    /// Force on the robot divided by the square of its radius, in Pa.
    pub(super) force_pa: f64,
    /// Constitutive law of the gel, discretised in time over one Runge–Kutta stage of a time step.
    pub(super) law: StageLaw<'a>,
    /// Unknowns at the start of the stage, in the order of the mesh's numbering.
    pub(super) start: &'a [f64],
    /// Conformations (stretch of the polymer in undeformed coordinates) from which the stage
    /// starts, by cell, point and mode.
    pub(super) configurations: &'a [Vec<Symmetric>],
    /// Relative volume change at zero pressure, by cell and point. Empty if the gel keeps its
    /// volume.
    pub(super) rests: &'a [Vec<f64>],
}

impl FieldStage<'_> {
    fn held<'a>(&'a self, cell: usize, start: &[Gradient]) -> Vec<PointConstants<'a>> {
        let configurations = self.configurations[cell].chunks_exact(self.law.modes.len().max(1));
        let empty: &[Symmetric] = &[];
        let configurations = configurations.chain(std::iter::repeat(empty));
        let rests = self.rests.get(cell).map_or(&[][..], |rests| rests);
        let of = |(q, (start, configurations)): (usize, (&Gradient, &'a [Symmetric]))| PointConstants {
            law: self.law,
            start: *start,
            configurations,
            rest: rests.get(q).copied().unwrap_or(0.0),
        };
        start.iter().zip(configurations).enumerate().map(of).collect()
    }
}

/// Forces that are not in balance in a cell, after condensation: those on its edges, and those in
/// its interior multiplied by the inverse of the interior's matrix.
struct CellForces {
    interior: Vec<f64>,
    edge: Vec<f64>,
}

/// Factorised matrix of one Runge–Kutta stage. Later stages with steps of similar length reuse it.
struct Factorised {
    cells: Vec<Condensed>,
    lu: SparseLu,
    rate_per_s: f64,
}

/// Solver that solves Runge–Kutta stages one after the other and keeps its last factorised matrix.
pub(super) struct Solver<'a> {
    mesh: &'a FieldMesh,
    factorised: Option<Factorised>,
    /// Number of Newton iterations so far.
    pub(super) iterations: usize,
    /// Number of factorisations so far.
    pub(super) factorisations: usize,
}

impl<'a> Solver<'a> {
    pub fn new(mesh: &'a FieldMesh) -> Self {
        Self { mesh, factorised: None, iterations: 0, factorisations: 0 }
    }

    /// Solves for the unknowns at which the forces of a stage are in balance, starting from a
    /// guess.
    pub(super) fn solve(&mut self, stage: &FieldStage, guess: Vec<f64>) -> Result<Vec<f64>> {
        let mesh = self.mesh;
        let starts: Vec<Vec<Gradient>> = mesh.cells.par_iter().map(|cell| mesh.gradients(cell, stage.start)).collect();
        let held: Vec<Vec<PointConstants>> =
            starts.iter().enumerate().map(|(cell, start)| stage.held(cell, start)).collect();
        let mut x = guess;
        let rate = stage.law.rate_per_s;
        // A step of another length has another matrix. If lengths grow slowly, the old matrix is
        // close enough.
        let mut factorised = match self.factorised.take() {
            Some(kept) if (kept.rate_per_s / rate).ln().abs() < 0.5 => kept,
            kept => self.factorise(&held, &x, rate, kept.as_ref())?,
        };
        let mut before = f64::INFINITY;
        for _ in 0..MOST_ITERATIONS {
            self.iterations += 1;
            let change = self.iterate(stage, &held, &factorised, &mut x);
            if !change.is_finite() {
                break;
            }
            if change < TOLERANCE {
                self.factorised = Some(factorised);
                return Ok(x);
            }
            if change > SLOW * before {
                factorised = self.factorise(&held, &x, rate, Some(&factorised))?;
                before = f64::INFINITY;
            } else {
                before = change;
            }
        }
        Err(lost())
    }

    /// Solves for the unknowns at which the forces of a stage are in balance at small strains, by
    /// one Newton step from rest.
    pub(super) fn linear(&mut self, stage: &FieldStage) -> Result<Vec<f64>> {
        let mesh = self.mesh;
        let mut x = vec![0.0; mesh.n_unknowns];
        let starts: Vec<Vec<Gradient>> = mesh.cells.iter().map(|cell| mesh.gradients(cell, stage.start)).collect();
        let held: Vec<Vec<PointConstants>> =
            starts.iter().enumerate().map(|(cell, start)| stage.held(cell, start)).collect();
        let factorised = self.factorise(&held, &x, stage.law.rate_per_s, None)?;
        self.iterate(stage, &held, &factorised, &mut x);
        Ok(x)
    }

    /// Takes one Newton step with a stored matrix. Returns the largest change of a displacement.
    fn iterate(&self, stage: &FieldStage, held: &[Vec<PointConstants>], factorised: &Factorised, x: &mut [f64]) -> f64 {
        let mesh = self.mesh;
        let of_cell = |((cell, held), condensed): ((&FieldCell, &Vec<PointConstants>), &Condensed)| {
            let (displacement, pressures) = mesh.local(cell, x);
            let f = cell.shape.gradients(&displacement);
            let all = cell.shape.forces(&mesh.reference, held, &f, &pressures);
            let mut interior: Vec<f64> = cell.interior.iter().map(|i| all[*i]).collect();
            let mut edge: Vec<f64> = cell.edge.iter().map(|i| all[*i]).collect();
            condensed.reduce(&mut interior, &mut edge);
            CellForces { interior, edge }
        };
        let forces: Vec<CellForces> = mesh.cells.par_iter().zip(held).zip(&factorised.cells).map(of_cell).collect();
        let mut changes = vec![0.0; mesh.n_global];
        changes[BODY] = stage.force_pa;
        for (cell, forces) in mesh.cells.iter().zip(&forces) {
            for (place, force) in cell.edge.iter().zip(&forces.edge) {
                if let Some(unknown) = cell.unknown[*place] {
                    changes[unknown] -= force;
                }
            }
        }
        factorised.lu.solve(&mut changes);
        let inside = |((cell, forces), condensed): ((&FieldCell, CellForces), &Condensed)| {
            let on_edge = cell.edge.iter().map(|place| cell.unknown[*place].map_or(0.0, |u| changes[u]));
            condensed.interior(forces.interior, &on_edge.collect::<Vec<f64>>())
        };
        let insides: Vec<Vec<f64>> = mesh.cells.par_iter().zip(forces).zip(&factorised.cells).map(inside).collect();
        let mut largest = 0.0_f64;
        let mut change = |unknown: usize, by: f64| {
            x[unknown] += by;
            if !mesh.is_pressure[unknown] {
                largest = if by.is_finite() { largest.max(by.abs()) } else { f64::INFINITY };
            }
        };
        changes.iter().enumerate().for_each(|(unknown, by)| change(unknown, *by));
        for (cell, values) in mesh.cells.iter().zip(&insides) {
            for (place, by) in cell.interior.iter().zip(values) {
                if let Some(unknown) = cell.unknown[*place] {
                    change(unknown, *by);
                }
            }
        }
        largest
    }

    fn factorise(
        &mut self,
        held: &[Vec<PointConstants>],
        x: &[f64],
        rate_per_s: f64,
        like: Option<&Factorised>,
    ) -> Result<Factorised> {
        let mesh = self.mesh;
        self.factorisations += 1;
        let condensed = |(cell, held): (&FieldCell, &Vec<PointConstants>)| {
            let (displacement, pressures) = mesh.local(cell, x);
            let f = cell.shape.gradients(&displacement);
            let matrix = cell.shape.matrix(&mesh.reference, held, &f, &pressures);
            Condensed::new(&matrix, &cell.interior, &cell.edge)
        };
        let cells: Vec<Condensed> = mesh.cells.par_iter().zip(held).map(condensed).collect();
        let entries: Vec<f64> = mesh
            .cells
            .iter()
            .zip(&cells)
            .flat_map(|(cell, condensed)| cell.places().map(|(a, b, _)| condensed.matrix[(a, b)]))
            .collect();
        let lu = SparseLu::new(&mesh.pattern, &entries, like.map(|like| &like.lu))?;
        Ok(Factorised { cells, lu, rate_per_s })
    }

    /// Smallest and largest ratio of deformed to undeformed volume. In an incompressible gel both
    /// are 1 up to the error of the mesh.
    pub(super) fn volume_ratios(&self, x: &[f64]) -> [f64; 2] {
        let of_cell = |cell: &FieldCell| {
            let ratios = self.mesh.gradients(cell, x).into_iter().map(|f| point::determinant(&f));
            ratios.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], j| [low.min(j), high.max(j)])
        };
        let all: Vec<[f64; 2]> = self.mesh.cells.par_iter().map(of_cell).collect();
        all.into_iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], [a, b]| [low.min(a), high.max(b)])
    }
}

fn lost() -> Error {
    Error::numerical("the balance of the gel was not found", "use a smaller force, a stiffer gel or a finer mesh")
}
