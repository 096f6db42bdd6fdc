//! Device that moves the gel: a bead in it, a tip that is pressed into it, or grips or plates that hold a specimen of it.

use std::f64::consts::PI;

use super::preamble::{Preamble, StatedValue};
use super::request::InitRequest;
use super::stress::{OF_SPECIMEN, StressStrain, called};
use base::error::Setting;
use base::toml_input::{UNKNOWN, quoted};
use record::STRESS_STRAIN;
use record::table::{Ask, PositionColumns, Question, TableProposal};

/// Names of the radius of a spherical tip in the lines above a table.
const RADIUS: [&str; 5] = ["tip radius", "tipradius", "probe radius", "indenter radius", "bead radius"];
/// Names of the stiffness of the spring that carries the tip. The value is in N/m.
const STIFFNESS: [&str; 5] =
    ["k (n/m)", "cantilever k (n/m)", "spring constant", "springconstant", "spring constant (n/m)"];
/// Names of a specimen's length between the grips, or of its height between plates.
const LENGTH: [&str; 12] = [
    "gauge length",
    "gage length",
    "initial length",
    "specimen length",
    "sample length",
    "grip separation",
    "specimen height",
    "sample height",
    "initial height",
    "einspannlänge",
    "messlänge",
    "anfangslänge",
];
/// Names of a specimen's cross-section.
const AREA: [&str; 9] = [
    "area",
    "cross-section",
    "cross section",
    "cross-sectional area",
    "cross sectional area",
    "specimen area",
    "sample area",
    "querschnitt",
    "querschnittsfläche",
];
/// Names of the sides of a rectangular cross-section, and of the diameter of a round one.
const WIDTH: [&str; 4] = ["width", "specimen width", "sample width", "breite"];
const THICKNESS: [&str; 4] = ["thickness", "specimen thickness", "sample thickness", "dicke"];
const DIAMETER: [&str; 4] = ["diameter", "specimen diameter", "sample diameter", "durchmesser"];

/// Words in the names of columns that instruments with a tip write.
const OF_TIP: [&str; 7] = ["indentation", "depth", "cantilever", "tip-sample", "tip sample", "piezo", "vdeflection"];
/// Words in the names of positions of the tip itself, from which the instrument has subtracted the deflection of the spring.
const OF_DEPTH: [&str; 6] = ["indentation", "tip position", "tipposition", "tip-sample", "tip sample", "separation"];
/// Words in the names of positions of the head that carries the spring.
const OF_HEAD: [&str; 3] = ["height", "piezo", "zsensor"];
/// Units of forces that no testing machine measures. A molecule in a trap also has an extension.
const MOLECULAR: [&str; 3] = ["fN", "pN", "nN"];

/// Device of a record, with its sizes as far as they are known.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Device {
    /// Bead or robot in a ball of gel: diameters of both in mm, and Poisson's ratio.
    Bead([Option<f64>; 3]),
    /// Stress and strain, of a rheometer or of a specimen of known sizes.
    StressStrain(Box<StressStrain>),
    /// Spherical tip that is pressed into the gel.
    Tip {
        /// Radius of the sphere in m.
        radius_m: Option<Size>,
        /// Stiffness in N/m of the spring that carries the tip; `None` if there is none, or if it is unknown.
        stiffness_n_per_m: Option<Size>,
        /// True if the position is that of the spring's far end, so that its stiffness must be known.
        needs_stiffness: bool,
    },
    /// Specimen of unknown sizes between grips or plates.
    Specimen,
}

/// Size with its origin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Size {
    pub value: f64,
    /// Line of the table that states it; `None` if the user has given it.
    line: Option<usize>,
}

impl From<StatedValue> for Size {
    fn from(stated: StatedValue) -> Self {
        Self { value: stated.value, line: Some(stated.line) }
    }
}

impl Size {
    fn given(value: f64) -> Self {
        Self { value, line: None }
    }

    /// Origin of the size, for a comment.
    fn origin(self) -> String {
        self.line.map_or("as given".into(), |line| format!("from line {line} of the table"))
    }
}

/// Size that the user is asked for.
struct PromptedSize {
    what: &'static str,
    allowed: fn(f64) -> bool,
    allowed_in_words: &'static str,
}

const fn above_zero(what: &'static str) -> PromptedSize {
    PromptedSize { what, allowed: |x| x > 0.0, allowed_in_words: "a size is above 0" }
}

const TIP_RADIUS: PromptedSize = above_zero("radius of the tip, a sphere, in µm");
const SPECIMEN_LENGTH: PromptedSize = above_zero("length of the specimen along the force, in mm");
const SPECIMEN_AREA: PromptedSize = above_zero("cross-section of the specimen, in mm²");
/// Keys of a bead's sizes in `experiment.toml`.
const BEAD_KEYS: [&str; 3] = ["robot.diameter_mm", "vitreous.diameter_mm", "vitreous.poisson_ratio"];
/// Sizes of a bead that the user may be asked for, in the order of [`InitRequest::sizes`].
const BEAD: [PromptedSize; 3] = [
    above_zero("diameter of the robot, a sphere, in mm"),
    above_zero("diameter of the vitreous in mm"),
    PromptedSize {
        what: "Poisson ratio of the vitreous (0.48 to 0.499 for a gel that is nearly incompressible)",
        allowed: |x| x > -1.0 && x < 0.5,
        allowed_in_words: "a Poisson ratio lies between −1 and 0.5, both excluded",
    },
];

impl PromptedSize {
    /// Asks the user for the size until the answer is an allowed value. `None` if the user does not know the value or cannot be asked.
    fn ask(&self, ask: Ask<'_>) -> Option<f64> {
        let mut text = self.what.to_string();
        loop {
            let question = Question { text, choices: Vec::new(), also: Vec::new(), proposal: Some(UNKNOWN.into()) };
            let answer = ask(&question)?;
            if answer == UNKNOWN {
                return None;
            }
            text = match answer.replace(',', ".").parse::<f64>() {
                Ok(value) if value.is_finite() && (self.allowed)(value) => return Some(value),
                Ok(_) => format!("`{answer}`: {}; {}", self.allowed_in_words, self.what),
                Err(_) => format!("`{answer}` is not a number; {}", self.what),
            };
            // A program may give the same wrong answer forever. The loop ends when a wrong answer is repeated.
            if text == question.text {
                return None;
            }
        }
    }
}

/// Length in m of a specimen between grips or plates, as the user gives it or as a line above the table states it.
pub(super) fn specimen_length_m(request: &InitRequest, preamble: Preamble<'_>) -> Option<Size> {
    let given = request.specimen[0].map(|length_mm| Size::given(1e-3 * length_mm));
    given.or_else(|| preamble.length_m(&LENGTH).map(Size::from))
}

impl Device {
    /// Device of a record of force and position: as the user says by a size, as the lines above the table state a size, or as the names of columns suggest; otherwise a bead.
    /// The sizes of a specimen turn the proposal into one of stress and strain. The reason is added to the proposal.
    pub fn of(request: &InitRequest, preamble: Preamble<'_>, proposal: &mut TableProposal, ask: Ask<'_>) -> Self {
        let is_given = |sizes: &[Option<f64>]| sizes.iter().any(Option::is_some);
        if is_given(&request.specimen) {
            return Self::specimen(request, preamble, proposal, None, ask);
        }
        if request.sizes[0].is_some() {
            return Self::bead(request, proposal, ask);
        }
        let stated_m = preamble.length_m(&RADIUS);
        let has_word = |name: &&String| OF_TIP.iter().any(|word| name.to_lowercase().contains(word));
        let because = if is_given(&request.tip) {
            None
        } else if let Some(radius) = stated_m {
            Some(format!(
                "line {} states the radius of a tip, so a spherical tip is pressed into the gel ([indenter])",
                radius.line
            ))
        } else if let Some(name) = proposal.columns.iter().find(has_word) {
            Some(format!(
                "`{name}` is a column of an instrument with a tip, which is pressed into the gel ([indenter]); for a bead in the gel give `{}`",
                Setting::RobotDiameter
            ))
        } else if let Some(name) = position_of_machine(proposal) {
            let because = format!("`{name}` is a column of a testing machine");
            return Self::specimen(request, preamble, proposal, Some(because), ask);
        } else if let Some(length) = preamble.length_m(&LENGTH) {
            let because = format!("line {} states the length of a specimen", length.line);
            return Self::specimen(request, preamble, proposal, Some(because), ask);
        } else {
            return Self::bead(request, proposal, ask);
        };
        proposal.reasons.extend(because);
        let [given_um, given_n_per_m] = request.tip;
        let given_m = given_um.map(|radius_um| Size::given(radius_um / 1e6));
        let radius_m = given_m.or(stated_m.map(Size::from)).or_else(|| Some(Size::given(TIP_RADIUS.ask(ask)? / 1e6)));
        let stiffness_n_per_m = given_n_per_m.map(Size::given).or_else(|| preamble.number(&STIFFNESS).map(Size::from));
        let is_of_head = has_position(proposal, &OF_HEAD) && !has_position(proposal, &OF_DEPTH);
        proposal.reasons.push(format!("use `{} generic` for a gel other than vitreous humour", Setting::Prior));
        Self::Tip { radius_m, stiffness_n_per_m, needs_stiffness: is_of_head && stiffness_n_per_m.is_none() }
    }

    fn bead(request: &InitRequest, proposal: &mut TableProposal, ask: Ask<'_>) -> Self {
        let mut sizes = request.sizes;
        for (size, asked) in sizes.iter_mut().zip(&BEAD) {
            *size = size.or_else(|| asked.ask(ask));
        }
        if sizes[0].is_none() {
            proposal.reasons.push(format!(
                "the record is taken for one of a bead in a gel ([robot]); for a tip that is pressed into a gel give `{}`, and for a specimen between grips or plates `{}` and `{}`",
                Setting::TipRadius, Setting::SpecimenLength, Setting::SpecimenArea
            ));
        }
        Self::Bead(sizes)
    }

    /// Specimen between grips or plates: stress and strain, if its sizes are given or stated above the table.
    fn specimen(
        request: &InitRequest,
        preamble: Preamble<'_>,
        proposal: &mut TableProposal,
        because: Option<String>,
        ask: Ask<'_>,
    ) -> Self {
        let length_m =
            specimen_length_m(request, preamble).or_else(|| Some(Size::given(1e-3 * SPECIMEN_LENGTH.ask(ask)?)));
        let area_m2 = cross_section_m2(request, preamble).or_else(|| Some(Size::given(1e-6 * SPECIMEN_AREA.ask(ask)?)));
        let (Some(length_m), Some(area_m2)) = (length_m, area_m2) else {
            let because = because.map_or(String::new(), |because| format!("{because}, so "));
            proposal.reasons.push(format!(
                "{because}a specimen between grips or plates is stretched or compressed; run `init` again with `{}`, `{}` and `{}`, or with `{}` for a bead in the gel",
                Setting::Replace, Setting::SpecimenLength, Setting::SpecimenArea, Setting::RobotDiameter
            ));
            return Self::Specimen;
        };
        proposal.rescale([1.0 / area_m2.value, 1.0 / length_m.value]);
        let sizes = format!(
            "the specimen is {} mm long ({}) with a cross-section of {} mm² ({})",
            significant(1e3 * length_m.value),
            length_m.origin(),
            significant(1e6 * area_m2.value),
            area_m2.origin()
        );
        Self::StressStrain(Box::new(StressStrain::of_specimen(sizes)))
    }

    /// Stress and strain of the record; `None` for a force and a position.
    pub fn stress_strain(&self) -> Option<&StressStrain> {
        match self {
            Self::StressStrain(of) => Some(of),
            _ => None,
        }
    }

    /// True for a tip that is pressed into the gel.
    pub fn is_tip(&self) -> bool {
        matches!(self, Self::Tip { .. })
    }

    /// Keys of `experiment.toml` that the user must fill in.
    pub fn unknown(&self) -> Vec<String> {
        match self {
            Self::Bead(sizes) => {
                let open = BEAD_KEYS.into_iter().zip(sizes).filter(|(_, size)| size.is_none());
                open.map(|(key, _)| key.to_string()).collect()
            }
            Self::Tip { radius_m, needs_stiffness, .. } => {
                let open =
                    [(radius_m.is_none(), "indenter.tip_radius_um"), (*needs_stiffness, "indenter.cantilever_n_per_m")];
                open.into_iter().filter(|(is_open, _)| *is_open).map(|(_, key)| key.to_string()).collect()
            }
            Self::Specimen => vec!["instrument.compliance_per_m".into()],
            Self::StressStrain(_) => Vec::new(),
        }
    }

    /// Writes the lines of the device, each as a key, a value and a comment. A key that begins a table of TOML contains the table's header and a line break.
    pub fn write(&self, request: &InitRequest, proposal: &TableProposal, line: &mut dyn FnMut(&str, String, &str)) {
        let number = |value: Option<f64>| value.map_or_else(|| quoted(UNKNOWN), |value| format!("{value:?}"));
        match self {
            Self::StressStrain(of) => {
                let value = format!("{:?}", of.compliance);
                line(
                    "\n[instrument]\ncompliance_per_m",
                    value,
                    "2 + 2ν: Young's modulus over shear modulus; 1 for tension",
                );
                line("measures", quoted(STRESS_STRAIN), "1 Pa is entered as 1 N, and a strain of 1 as 1 m");
            }
            Self::Specimen => {
                let what = "length of the specimen over its cross-section, for tension and compression";
                line("\n[instrument]\ncompliance_per_m", quoted(UNKNOWN), what);
            }
            Self::Tip { radius_m, stiffness_n_per_m, needs_stiffness } => {
                line(
                    "\n[indenter]\nexponent",
                    "1.5".into(),
                    "1.5 for a sphere, 2 for a cone or pyramid, 1 for a flat punch",
                );
                let origin = radius_m.map_or("of the sphere; remove the line if it is not known".into(), Size::origin);
                line("tip_radius_um", number(radius_m.map(|radius| (1e12 * radius.value).round() / 1e6)), &origin);
                line("poisson_ratio", number(request.sizes[2].or(Some(0.5))), "of the gel; 0.5 if it keeps its volume");
                if *needs_stiffness {
                    let why = "stiffness of the spring that carries the tip; remove the line if there is none";
                    line("cantilever_n_per_m", quoted(UNKNOWN), why);
                }
                if let Some(stiffness) = stiffness_n_per_m {
                    let is_depth = has_position(proposal, &OF_DEPTH);
                    let key = if is_depth { "# cantilever_n_per_m" } else { "cantilever_n_per_m" };
                    let why =
                        if is_depth { "; the table gives the depth, which the spring does not change" } else { "" };
                    line(key, format!("{:?}", stiffness.value), &format!("{}{why}", stiffness.origin()));
                }
            }
            Self::Bead([diameter, vitreous, poisson]) => {
                line(
                    "\n[robot]\nshape",
                    quoted("sphere"),
                    "or \"ellipsoid\", \"cylinder\" with `length_mm` and `orientation`",
                );
                line("diameter_mm", number(*diameter), "of the moving body");
                let density = format!("{:?}", request.robot_density_kg_m3.unwrap_or(7500.0));
                let key = if request.robot_density_kg_m3.is_some() { "density_kg_m3" } else { "# density_kg_m3" };
                line(key, density, "of the moving body; used only for inertia");
                let outer = "of the gel around the robot; the gel's outer surface is fixed";
                line("\n[vitreous]\ndiameter_mm", number(*vitreous), outer);
                line("poisson_ratio", number(*poisson), "0.48 to 0.499 for a gel that is nearly incompressible");
                line("density_kg_m3", "1000.0".into(), "density of water, as a default");
            }
        }
    }
}

/// Number with at most four significant digits, as a sentence shows it.
fn significant(value: f64) -> f64 {
    format!("{value:.3e}").parse().unwrap_or(value)
}

/// Cross-section of a specimen that the user gives or the lines above a table state, or that follows from its sides or its diameter.
pub(super) fn cross_section_m2(request: &InitRequest, preamble: Preamble<'_>) -> Option<Size> {
    let given = request.specimen[1].map(|area_mm2| Size::given(1e-6 * area_mm2));
    let sides = || {
        let [width, thickness] = [preamble.length_m(&WIDTH)?, preamble.length_m(&THICKNESS)?];
        Some(Size { value: width.value * thickness.value, line: Some(thickness.line) })
    };
    let round = || {
        let diameter = preamble.length_m(&DIAMETER)?;
        Some(Size { value: 0.25 * PI * diameter.value * diameter.value, line: Some(diameter.line) })
    };
    given.or_else(|| preamble.area_m2(&AREA).map(Size::from)).or_else(sides).or_else(round)
}

/// Name of the column of the position, if a testing machine writes it.
fn position_of_machine(proposal: &TableProposal) -> Option<String> {
    let is_molecular = proposal.description.force.as_ref().is_some_and(|(_, unit)| MOLECULAR.contains(&&*unit.name));
    let (columns, _) = proposal.description.position.as_ref()?;
    let PositionColumns::Along(column) = columns else { return None };
    let name = column.to_string();
    let is_named = OF_SPECIMEN.iter().any(|word| name.to_lowercase().contains(word));
    (is_named && !is_molecular).then_some(name)
}

/// True if the name of the position's column contains one of the words.
pub(super) fn has_position(proposal: &TableProposal, words: &[&str]) -> bool {
    let positions = proposal.description.position.as_ref();
    positions.is_some_and(|(columns, _)| columns.all().iter().any(|column| called(&column.to_string(), words, &[])))
}
