//! What was measured: apparatus, force command, positions, cycles.

/// One experiment, validated, in SI units.
#[derive(Debug, Clone, PartialEq)]
pub struct Experiment {
    /// Specimen identifier, `[specimen] id`.
    pub specimen_id: String,
    /// Free text; groups are formed by it.
    pub species: Option<String>,
    /// Region of the eye, free text.
    pub region: Option<String>,
    /// What turns force into position.
    pub apparatus: Apparatus,
    /// Force and position against time.
    pub record: Record,
    /// Cycles that the base model is fitted to.
    pub calibration_cycles: Vec<u32>,
    /// Cycles that no fit of the base model sees.
    pub heldout_cycles: Vec<u32>,
    /// The tracker's known noise, in m, if stated.
    pub noise_sd_m: Option<f64>,
    /// Where the data come from; synthetic or measured.
    pub source: String,
}

/// What turns force into position.
#[derive(Debug, Clone, PartialEq)]
pub enum Apparatus {
    /// A robot inside the vitreous: the finite-element model applies.
    Robot {
        /// The moving body.
        robot: Robot,
        /// What surrounds it.
        vitreous: Vitreous,
    },
    /// Another instrument: position = compliance × ∫J dF.
    Instrument {
        /// Displacement per force, per Pa⁻¹ of creep compliance, in 1/m.
        compliance_per_m: f64,
    },
}

/// The moving body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Robot {
    /// Its shape and sizes.
    pub shape: RobotShape,
    /// Density in kg/m³.
    pub density_kg_m3: f64,
}

/// Shape of the robot, sizes in m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RobotShape {
    /// A sphere.
    Sphere {
        /// Diameter in m.
        diameter_m: f64,
    },
    /// A prolate ellipsoid of revolution.
    Ellipsoid {
        /// Long axis in m.
        length_m: f64,
        /// Short axes in m.
        diameter_m: f64,
        /// Long axis relative to the force.
        orientation: Orientation,
    },
    /// A circular cylinder.
    Cylinder {
        /// Length in m.
        length_m: f64,
        /// Diameter in m.
        diameter_m: f64,
        /// Long axis relative to the force.
        orientation: Orientation,
    },
}

/// Direction of the long axis relative to the force.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Orientation {
    /// Along the force.
    Horizontal,
    /// Across the force.
    Vertical,
}

/// The gel ball around the robot; its outer surface is fixed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Vitreous {
    /// Diameter in m.
    pub diameter_m: f64,
    /// Poisson ratio, in (−1, 0.5).
    pub poisson_ratio: f64,
    /// Density in kg/m³.
    pub density_kg_m3: f64,
}

/// Rows of the trajectory, SI. All vectors have the same length.
#[derive(Debug, Clone, PartialEq)]
pub struct Record {
    /// Times in s, strictly increasing.
    pub time_s: Vec<f64>,
    /// Commanded force in N; row i holds on [tᵢ, tᵢ₊₁).
    pub force_n: Vec<f64>,
    /// Position in m, limit from the left; `None` where tracking was lost.
    pub position_m: Vec<Option<f64>>,
    /// Cycle of each row, counted from 1.
    pub cycle: Vec<u32>,
}
