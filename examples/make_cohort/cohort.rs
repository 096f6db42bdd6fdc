//! A synthetic cohort: three species, three regions, differing specimens, repeats, one outlier, one missing cell.
//!
//! `data/cohort/README.md` gives the origin of every number. The logarithms of an experiment's parameters E, c₁ and c₂ are sums of three parts: values for its
//! species and region, a deviation of the specimen, and a deviation of the experiment (location or repeat).

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use vitreo_uq::Result;
use vitreo_uq::elements::fe::Stiffness;
use vitreo_uq::elements::fe::time::{FullOrderModel, TimeScheme};
use vitreo_uq::laws::rheology::CreepCompliance;
use vitreo_uq::posterior::mechanics::robot_mesh;
use vitreo_uq::posterior::replica::TABLE_I;
use vitreo_uq::record::{Robot, RobotShape, Vitreous};

const SEED: u64 = 20080917;

/// A species: its eyes and assumed medians.
pub struct Species {
    pub name: &'static str,
    n_specimens: u64,
    regions: &'static [Region],
    /// Ratios of E, c₁, c₂ to those of Table I.
    pub ratio_to_porcine: [f64; 3],
    pub vitreous_diameter_mm: f64,
    /// Specimens, counted from 1, whose central region is measured twice.
    repeated: &'static [u64],
}

/// Ratio of the storage moduli of Nickerson et al. 2008, 7.0 Pa to 2.8 Pa.
const BOVINE: f64 = 7.0 / 2.8;

pub const SPECIES: [Species; 3] = [
    Species {
        name: "porcine",
        n_specimens: 8,
        regions: &REGIONS,
        ratio_to_porcine: [1.0; 3],
        vitreous_diameter_mm: 20.0,
        repeated: &[1, 4, 7],
    },
    Species {
        name: "bovine",
        n_specimens: 7,
        regions: &REGIONS,
        ratio_to_porcine: [BOVINE; 3],
        vitreous_diameter_mm: 26.0,
        repeated: &[],
    },
    Species {
        name: "human",
        n_specimens: 6,
        regions: REGIONS.split_at(2).0,
        ratio_to_porcine: [0.6, 0.6, 0.5],
        vitreous_diameter_mm: 20.0,
        repeated: &[],
    },
];

/// A region with its factor on all parameters.
pub struct Region {
    pub name: &'static str,
    pub factor: f64,
}

pub const REGIONS: [Region; 3] = [
    Region { name: "anterior", factor: 0.8 },
    Region { name: "central", factor: 1.0 },
    Region { name: "posterior", factor: 1.25 },
];

/// Standard deviations of ln E, ln c₁, ln c₂ between specimens of a species.
pub const BETWEEN_LOG_SD: [f64; 3] = [0.31, 0.29, 0.35];
/// Standard deviations of ln E, ln c₁, ln c₂ between experiments on one specimen.
pub const WITHIN_LOG_SD: [f64; 3] = [0.21; 3];
/// Correlation of any two log parameters, between specimens and between experiments.
pub const CORRELATION: f64 = 0.5;
/// A specimen outside its population, with the factor on all its parameters.
pub const OUTLIER: (&str, f64) = ("bovine-05", 0.2);
/// Standard deviations of white noise in µm; every experiment has one of these values.
pub const NOISE_UM: [f64; 5] = [3.0, 4.0, 5.0, 6.0, 8.0];

const MM_PER_M: f64 = 1e3;
const ROBOT_DIAMETER_MM: f64 = 0.55;
const ROBOT_DENSITY_KG_M3: f64 = 7500.0;
const VITREOUS_DENSITY_KG_M3: f64 = 1000.0;
const POISSON_RATIO: f64 = 0.48;
const FORCE_UN: f64 = 4.6;
const INTERVAL_S: f64 = 0.08;
const ROWS_PER_HOLD: usize = 50;
const N_ROWS: usize = 6 * ROWS_PER_HOLD;
/// Mesh level of the data, one above the program's own model.
const MESH_LEVEL: usize = 4;
/// Number of time steps per sample, by the implicit midpoint rule: the fewest with an error below a fiftieth of every experiment's noise.
pub const STEPS_PER_SAMPLE: usize = 10;

/// Missing part of a record.
#[derive(Clone, Copy, PartialEq)]
enum Missing {
    /// Every position is missing with this probability.
    Positions(f64),
    /// Positions of these rows are missing.
    Blink(usize, usize),
    /// These rows are missing completely. The force is constant from the row before to the row after.
    Rows(usize, usize),
}

const MISSING: [(&str, Missing); 4] = [
    ("porcine-03-posterior", Missing::Blink(118, 143)),
    ("porcine-06-central", Missing::Rows(62, 84)),
    ("bovine-06-central", Missing::Positions(0.08)),
    ("human-02-anterior", Missing::Positions(0.15)),
];

/// One experiment of the cohort.
pub struct Experiment {
    /// Name of its directory.
    pub name: String,
    pub specimen: String,
    pub species: &'static Species,
    pub region: &'static str,
    /// E (Pa), c₁ (Pa·s), c₂ (Pa·s).
    pub parameters: [f64; 3],
    pub noise_um: f64,
    /// Unusual property of the experiment.
    pub note: &'static str,
    /// Random number generator after the parameters and the size of the noise were drawn.
    random: ChaCha8Rng,
    missing: Option<Missing>,
}

/// All experiments, sorted by species, specimen and region.
pub fn experiments() -> Vec<Experiment> {
    let mut all = Vec::new();
    for (code, species) in (1..).zip(&SPECIES) {
        for number in 1..=species.n_specimens {
            let specimen = format!("{}-{number:02}", species.name);
            // Every specimen and every experiment on it has its own stream, so adding one leaves the others unchanged.
            let stream = |place: u64| {
                let mut random = ChaCha8Rng::seed_from_u64(SEED);
                random.set_stream(16 * (1000 * code + number) + place);
                random
            };
            let values = deviation(BETWEEN_LOG_SD, &mut stream(0));
            let outlier = if specimen == OUTLIER.0 { OUTLIER.1 } else { 1.0 };
            for (place, region) in (1..).zip(species.regions) {
                let n_runs = 1 + u64::from(region.name == "central" && species.repeated.contains(&number));
                for run in 0..n_runs {
                    let suffix = if run == 0 { "" } else { "-repeat" };
                    let name = format!("{specimen}-{}{suffix}", region.name);
                    let mut random = stream(place + 8 * run);
                    let here = deviation(WITHIN_LOG_SD, &mut random);
                    let parameters = std::array::from_fn(|i| {
                        let median = TABLE_I[i] * species.ratio_to_porcine[i] * region.factor * outlier;
                        median * (values[i] + here[i]).exp()
                    });
                    let noise_um = NOISE_UM[random.random_range(0..NOISE_UM.len())];
                    let missing = MISSING.iter().find(|(of, _)| *of == name).map(|(_, missing)| *missing);
                    let note = match missing {
                        _ if outlier != 1.0 => "outlier",
                        Some(Missing::Positions(_) | Missing::Blink(..)) => "positions lost",
                        Some(Missing::Rows(..)) => "gap",
                        None if run > 0 => "repeat",
                        None => "",
                    };
                    all.push(Experiment {
                        name,
                        specimen: specimen.clone(),
                        species,
                        region: region.name,
                        parameters,
                        noise_um,
                        note,
                        random,
                        missing,
                    });
                }
            }
        }
    }
    all
}

/// Draws three normal numbers with the standard deviations `log_sd`. A common part gives any two of them the correlation [`CORRELATION`].
pub fn deviation(log_sd: [f64; 3], random: &mut ChaCha8Rng) -> [f64; 3] {
    let mut normal = || -> f64 { StandardNormal.sample(random) };
    let common = CORRELATION.sqrt() * normal();
    log_sd.map(|sd| sd * (common + (1.0 - CORRELATION).sqrt() * normal()))
}

impl Species {
    /// Returns the moving body and its surroundings.
    pub fn apparatus(&self) -> (Robot, Vitreous) {
        let robot = Robot {
            shape: RobotShape::Sphere { diameter_m: ROBOT_DIAMETER_MM / MM_PER_M },
            density_kg_m3: Some(ROBOT_DENSITY_KG_M3),
            offset: None,
        };
        let vitreous = Vitreous {
            diameter_m: self.vitreous_diameter_mm / MM_PER_M,
            poisson_ratio: POISSON_RATIO,
            density_kg_m3: Some(VITREOUS_DENSITY_KG_M3),
        };
        (robot, vitreous)
    }

    /// Full finite elements of the apparatus, before factorisation.
    pub fn stiffness(&self) -> Result<Stiffness> {
        let (robot, vitreous) = self.apparatus();
        Stiffness::new(&robot_mesh(&robot, &vitreous, MESH_LEVEL)?)
    }
}

/// Factorised finite elements of a species, shared by all its experiments.
pub fn model(stiffness: &Stiffness) -> Result<FullOrderModel> {
    FullOrderModel::new(stiffness, POISSON_RATIO)
}

impl Experiment {
    /// Positions (µm) without noise, one per row.
    pub fn positions_um(&self, model: &FullOrderModel, scheme: TimeScheme) -> Vec<f64> {
        let n_steps = N_ROWS * STEPS_PER_SAMPLE;
        let time_s: Vec<f64> = (0..n_steps).map(|i| INTERVAL_S * i as f64 / STEPS_PER_SAMPLE as f64).collect();
        let force_n: Vec<f64> = (0..n_steps).map(|i| 1e-6 * force_un(i / STEPS_PER_SAMPLE)).collect();
        let load = model.solve_load(&time_s, &force_n);
        let position_m = model.trajectory(&load, &CreepCompliance::lethersich(&self.parameters), scheme);
        position_m.iter().step_by(STEPS_PER_SAMPLE).map(|x| 1e6 * x).collect()
    }

    /// Text of `trajectory.csv`.
    pub fn trajectory_csv(&self, model: &FullOrderModel) -> String {
        let mut random = self.random.clone();
        let mut csv = String::from("time_s,force_uN,position_um,cycle\n");
        for (row, position_um) in self.positions_um(model, TimeScheme::Midpoint).into_iter().enumerate() {
            let noise: f64 = StandardNormal.sample(&mut random);
            let (force, cycle) = (force_un(row), 1 + row / (2 * ROWS_PER_HOLD));
            let lost = match self.missing {
                Some(Missing::Rows(first, end)) if (first..end).contains(&row) => continue,
                Some(Missing::Blink(first, end)) => (first..end).contains(&row),
                Some(Missing::Positions(probability)) => random.random_bool(probability),
                _ => false,
            };
            let position = if lost { String::new() } else { format!("{:.2}", position_um + self.noise_um * noise) };
            csv += &format!("{:.2},{force:.1},{position},{cycle}\n", INTERVAL_S * row as f64);
        }
        csv
    }

    /// Text of `experiment.toml`.
    pub fn toml(&self) -> String {
        let Self { name, specimen, species, region, noise_um, .. } = self;
        format!(
            "# SYNTHETIC. {name} of a made-up cohort, no eye was measured: full finite elements on a finer mesh and time step than the program's own,\n\
             # plus white noise. ../README.md says where each number comes from, ../truth.csv holds the parameters.\n\
             # Made by: cargo run --release --example make_cohort\n\
             [specimen]\nid = \"{specimen}\"\nspecies = \"{}\"\nregion = \"{region}\"\n\n\
             [robot]\nshape = \"sphere\"\ndiameter_mm = {ROBOT_DIAMETER_MM}\ndensity_kg_m3 = {ROBOT_DENSITY_KG_M3}\n\n\
             [vitreous]\ndiameter_mm = {:.1}\npoisson_ratio = {POISSON_RATIO}\ndensity_kg_m3 = {VITREOUS_DENSITY_KG_M3}\n\n\
             [measurement]\nfile = \"trajectory.csv\"\ncalibration_cycles = [1]\nheldout_cycles = [2, 3]\nnoise_um = {noise_um:.1}\n\
             source = \"SYNTHETIC: full finite elements, {noise_um} µm white noise; no eye was measured\"\n",
            species.name, species.vitreous_diameter_mm,
        )
    }
}

/// Force (µN) that holds from a row to the next.
fn force_un(row: usize) -> f64 {
    if (row / ROWS_PER_HOLD).is_multiple_of(2) { FORCE_UN } else { -FORCE_UN }
}

/// Text of `truth.csv`.
pub fn truth_csv(experiments: &[Experiment]) -> String {
    let mut csv = String::from(
        "experiment,specimen,species,region,young_modulus_pa,viscosity_1_pa_s,viscosity_2_pa_s,noise_um,note\n",
    );
    for Experiment { name, specimen, species, region, parameters: [e, c1, c2], noise_um, note, .. } in experiments {
        csv += &format!("{name},{specimen},{},{region},{e:.6},{c1:.6},{c2:.6},{noise_um:.1},{note}\n", species.name);
    }
    csv
}
