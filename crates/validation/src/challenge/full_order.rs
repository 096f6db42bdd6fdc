//! Computes the noise-free trajectories of truths with the full-order model, and caches them on disk.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use base::sha256::sha256_hex;
use rayon::prelude::*;

use super::large::{self, LargeGel, robot_of};
use super::{ApparatusError, Bench, Truth};
use base::error::{Error, Result, Setting};
use base::files::{Content, read_if_there, write_atomically};
use base::number::Dual;
use elements::fe::spatial::{GelAndRobot, PhysicalProperties, SpatialInput};
use elements::fe::stepping::Resolution;
use elements::fe::time::FullOrderModel;
use elements::fe::{Stiffness, transient};
use elements::mesh::Mesh;
use laws::stages::Spatial;
use models::model::{Forward, FullOrderForward};
use posterior::mechanics::{MODEL_LEVEL, robot_mesh, sizes_of};
use posterior::monitor::Monitor;
use posterior::study::ModelSpecification;
use record::Force;

/// Level of the mesh that the data are simulated on. The fitted model uses the next coarser level.
const DATA_LEVEL: usize = MODEL_LEVEL + 1;
/// Factor by which the data's time steps are shorter than those of the fitted model. The factor does not apply to effects that change the displacement field.
/// Their surrogates have no time steps, or other time steps.
const FINER_STEPS: u32 = 2;

/// Returns the noise-free position (m) at every row, for each truth. The full-order model uses a finer mesh and shorter time steps than the fitted model. Three
/// kinds of truths have their own elements: linear effects that change the displacement field around a sphere, nonlinear laws, and large displacements.
/// Trajectories in the directory `cache` are reused; others are computed and stored there.
///
/// # Errors
/// [`Error::Numerical`] if a truth has no full-order model; [`Error::File`] if the cache cannot be written.
pub fn trajectories_m(
    bench: &Bench,
    truths: &[Truth],
    cache: Option<&Path>,
    monitor: &dyn Monitor,
) -> Result<Vec<Vec<f64>>> {
    if let Some(folder) = cache {
        std::fs::create_dir_all(folder).map_err(|source| {
            Error::at_path("create", folder, source, format!("give a writable directory with `{}`", Setting::Cache))
        })?;
    }
    // Several challenges without hidden effects have equal truths, so each distinct truth is computed once.
    let keys: Vec<String> = truths.iter().map(key).collect();
    let mut needed: BTreeMap<&str, &Truth> = BTreeMap::new();
    let mut known: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    for (key, truth) in keys.iter().zip(truths) {
        if needed.contains_key(key.as_str()) || known.contains_key(key.as_str()) {
            continue;
        }
        match cache.and_then(|folder| read(&place(folder, key), truth.protocol.record().n_rows())) {
            Some(position_m) => drop(known.insert(key, position_m)),
            None => drop(needed.insert(key, truth)),
        }
    }
    if !needed.is_empty() {
        monitor.stage(&format!("computing {} trajectories with full finite elements", needed.len()));
        let workshop = DataSolver::new(bench)?;
        let full = FullOrderModel::new(&workshop.stiffness, workshop.poisson_ratio)?;
        let places = off_centre(bench, needed.values())?;
        let models: Vec<(ApparatusError, FullOrderModel)> = places
            .par_iter()
            .map(|(error, stiffness)| Ok((*error, FullOrderModel::new(stiffness, workshop.poisson_ratio)?)))
            .collect::<Result<_>>()?;
        let compute = |truth: &Truth| -> Result<Vec<f64>> {
            if let Some(mobility) = bench.mobility_of(truth) {
                let gel = LargeGel::new(bench.apparatus(), &large::DATA)?;
                return gel.position_m(truth.law, mobility, &truth.protocol.record());
            }
            let pair = models.iter().find(|(error, _)| truth.apparatus == Some(*error));
            let full = pair.map_or(&full, |(_, model)| model);
            workshop.trajectory_m(bench, full, truth)
        };
        let kept = |key: &str, truth: &Truth| -> Result<Vec<f64>> {
            let position_m = compute(truth)?;
            if let Some(folder) = cache {
                let bytes: Vec<u8> = position_m.iter().flat_map(|x| x.to_le_bytes()).collect();
                write_atomically(&place(folder, key), &bytes)?;
            }
            Ok(position_m)
        };
        let computed: Vec<(&str, Vec<f64>)> =
            needed.into_par_iter().map(|(key, truth)| Ok((key, kept(key, truth)?))).collect::<Result<_>>()?;
        known.extend(computed);
    }
    Ok(keys.iter().map(|key| known[key.as_str()].clone()).collect())
}

/// Stiffness matrices on the data's mesh, one for each true position of the robot that differs from the stated position at the centre.
fn off_centre<'a>(
    bench: &Bench,
    truths: impl Iterator<Item = &'a &'a Truth>,
) -> Result<Vec<(ApparatusError, Stiffness)>> {
    let (robot, vitreous) = robot_of(bench.apparatus())?;
    let mut errors: Vec<ApparatusError> = Vec::new();
    for error in truths.filter_map(|truth| truth.apparatus) {
        if error.robot(robot) != *robot && !errors.contains(&error) {
            errors.push(error);
        }
    }
    let stiffness = |error: ApparatusError| Stiffness::new(&robot_mesh(&error.robot(robot), vitreous, DATA_LEVEL)?);
    errors.into_iter().map(|error| Ok((error, stiffness(error)?))).collect()
}

/// Hash of everything that a trajectory depends on. It names the cached file.
fn key(truth: &Truth) -> String {
    let parameters: Vec<_> = truth.effects.iter().map(|effect| (&effect.slug, &effect.parameters)).collect();
    let text = format!(
        "{} {DATA_LEVEL} {FINER_STEPS} {:?} {:?} {parameters:?} {:?} {:?}",
        env!("CARGO_PKG_VERSION"),
        truth.protocol,
        truth.law,
        truth.outside,
        truth.apparatus
    );
    sha256_hex(text.as_bytes())
}

fn place(folder: &Path, key: &str) -> PathBuf {
    folder.join(format!("{key}.f64"))
}

/// Reads a cached trajectory. Returns `None` if it is missing or damaged.
fn read(path: &Path, n_rows: usize) -> Option<Vec<f64>> {
    let bytes = read_if_there(path, Content::Table)?;
    let (numbers, []) = bytes.as_chunks::<8>() else { return None };
    let position_m: Vec<f64> = numbers.iter().map(|number| f64::from_le_bytes(*number)).collect();
    (position_m.len() == n_rows && position_m.iter().all(|x| x.is_finite())).then_some(position_m)
}

/// Full-order model for the data, on a finer mesh than that of the fitted model.
struct DataSolver {
    mesh: Mesh,
    stiffness: Stiffness,
    poisson_ratio: f64,
    sizes: PhysicalProperties,
    resolution: Resolution,
}

impl DataSolver {
    fn new(bench: &Bench) -> Result<Self> {
        let (robot, vitreous) = robot_of(bench.apparatus())?;
        let mesh = robot_mesh(robot, vitreous, DATA_LEVEL)?;
        let stiffness = Stiffness::new(&mesh)?;
        let resolution = Resolution { steps_per_doubling: FINER_STEPS * Resolution::default().steps_per_doubling };
        let (poisson_ratio, sizes) = (vitreous.poisson_ratio, sizes_of(robot, vitreous, Some(DATA_LEVEL)));
        Ok(Self { mesh, stiffness, poisson_ratio, sizes, resolution })
    }

    /// Computes the positions (m) of a truth. `full` is factorised at the stated Poisson ratio, with the robot at its true place.
    fn trajectory_m(&self, bench: &Bench, full: &FullOrderModel, truth: &Truth) -> Result<Vec<f64>> {
        let record = truth.protocol.record();
        let still = bench.subject_of(truth.protocol, &vec![0.0; record.n_rows()])?;
        let effects = truth.effects.iter().map(|effect| effect.slug.clone()).collect();
        let specification = ModelSpecification { effects, ..still.specification().clone() };
        let model = still.problem().with_model(specification, bench.library())?.model;
        let of_effects = truth.effects.iter().flat_map(|effect| &effect.parameters).map(|parameter| parameter.value);
        let values: Vec<Dual> = truth.law.into_iter().chain(of_effects).map(Dual::constant).collect();
        let stages = model.stages(&values)?;
        let wrong_ratio = match truth.apparatus {
            Some(ApparatusError::PoissonRatio(ratio)) => Some(ratio),
            _ => None,
        };
        let force_n = truth.outside.as_ref().map_or_else(|| record.force_n.clone(), |outside| outside.force_n(&record));
        let force = Force { at_rows_n: &force_n, rule: record.force_rule };
        let Self { mesh, stiffness, sizes, .. } = self;
        let poisson_ratio = wrong_ratio.unwrap_or(self.poisson_ratio);
        let surroundings = GelAndRobot { mesh, stiffness, poisson_ratio, sizes: *sizes };
        let in_half_meridian = match (&stages.spatial, model.field()) {
            (Some(Spatial::Linear(linear)), Some((_, field))) => {
                let (time_s, resolution) = (&record.time_s, transient::Resolution::default());
                let job = SpatialInput { stages: &stages, time_s, force, rows: &[], resolution };
                field.run_in_half_meridian(&surroundings, linear, &job)?
            }
            _ => None,
        };
        let position_m = if let Some(position_m) = in_half_meridian {
            position_m
        } else if stages.spatial.is_some() {
            let values: Vec<f64> = values.iter().map(|value| value.value).collect();
            let at_ratio = FullOrderModel::new(stiffness, poisson_ratio)?;
            FullOrderForward::new(&model, stiffness, at_ratio, &record.time_s, force)
                .in_surroundings(surroundings)
                .trajectory_m(&values)?
        } else {
            let stepped = match stages.poisson_ratio.map(|ratio| ratio.value).or(wrong_ratio) {
                Some(ratio) => {
                    FullOrderModel::new(&self.stiffness, ratio)?.step(&stages, &record.time_s, force, self.resolution)
                }
                None => full.step(&stages, &record.time_s, force, self.resolution),
            };
            stepped?.position_m
        };
        Ok(match &truth.outside {
            Some(outside) => outside.recorded_m(&record, &position_m),
            None => position_m,
        })
    }
}
