//! JSON Schemas (draft 2020-12) of the documents that commands write, generated from the Rust types. They are stored in
//! `docs/schemas/<kind>-<number>.json`.

use schemars::JsonSchema;
use schemars::generate::SchemaSettings;
use serde_json::{Value, json};

use documents::calibration::Calibration;
use documents::check::CheckSummary;
use documents::cohort::CohortDiagnosis;
use documents::comparison::Comparison;
use documents::design::Design;
use documents::diagnosis::Diagnosis;
use documents::effects::EffectsSummary;
use documents::extension::ExtensionSummary;
use documents::fit::FitSummary;
use documents::groups::GroupsSummary;
use documents::init::InitSummary;
use documents::joint::JointSummary;
use documents::ladder::LadderSummary;
use documents::laws::LawComparison;
use documents::learned::Learned;
use documents::learned_cohort::LearnedCohort;
use documents::oscillation::{OscillationDiagnosis, OscillationSummary};
use documents::posterior::PosteriorSummary;
use documents::prediction::{Plan, Prediction};
use documents::shapes::ShapesSummary;
use documents::simulation::SimulationSummary;
use documents::tasks::{Gathered, TaskList};
use posterior::study::WithProvenance;
use validation::challenge::plays::Plays;

/// JSON Schema of one kind of document.
#[derive(Debug, Clone, PartialEq)]
pub struct DocumentSchema {
    /// Kind of the document, the second part of its identifier `vitreo-uq/<kind>/<number>`.
    pub kind: &'static str,
    /// Version number of the document's format.
    pub number: u32,
    /// The schema itself, as JSON.
    pub schema: Value,
}

impl DocumentSchema {
    fn of<T: JsonSchema>(kind: &'static str, command: &str) -> Self {
        let number = 1;
        let generator = SchemaSettings::draft2020_12().for_serialize().into_generator();
        let mut schema = generator.into_root_schema_for::<WithProvenance<T>>().to_value();
        schema["title"] = json!(format!("Document of `vitreo-uq {command}`"));
        schema["properties"]["schema"]["const"] = json!(format!("vitreo-uq/{kind}/{number}"));
        Self { kind, number, schema }
    }

    /// Name of the file that stores the schema.
    pub fn file_name(&self) -> String {
        format!("{}-{}.json", self.kind, self.number)
    }

    /// Content of the file that stores the schema.
    pub fn text(&self) -> String {
        format!("{:#}\n", self.schema)
    }
}

/// Makes the schemas of all documents that commands write.
pub fn all() -> Vec<DocumentSchema> {
    vec![
        DocumentSchema::of::<Calibration>("calibration", "gather"),
        DocumentSchema::of::<Plays>("challenge", "challenge run"),
        DocumentSchema::of::<CheckSummary>("check", "check"),
        DocumentSchema::of::<CohortDiagnosis>("cohort-diagnosis", "diagnose"),
        DocumentSchema::of::<Comparison>("comparison", "compare"),
        DocumentSchema::of::<Design>("design", "design"),
        DocumentSchema::of::<Diagnosis>("diagnosis", "diagnose"),
        DocumentSchema::of::<JointSummary>("joint", "sample"),
        DocumentSchema::of::<OscillationSummary>("oscillation", "sample"),
        DocumentSchema::of::<OscillationDiagnosis>("oscillation-diagnosis", "diagnose"),
        DocumentSchema::of::<EffectsSummary>("effects", "effects"),
        DocumentSchema::of::<ExtensionSummary>("extension", "extend"),
        DocumentSchema::of::<FitSummary>("fit", "fit"),
        DocumentSchema::of::<Gathered>("gathered", "gather"),
        DocumentSchema::of::<GroupsSummary>("groups", "groups"),
        DocumentSchema::of::<InitSummary>("init", "init"),
        DocumentSchema::of::<LadderSummary>("ladder", "ladder"),
        DocumentSchema::of::<LawComparison>("laws", "compare --laws"),
        DocumentSchema::of::<Learned>("learned", "learn"),
        DocumentSchema::of::<LearnedCohort>("learned-cohort", "learn"),
        DocumentSchema::of::<Plan>("plan", "plan"),
        DocumentSchema::of::<PosteriorSummary>("posterior", "sample"),
        DocumentSchema::of::<Prediction>("prediction", "predict"),
        DocumentSchema::of::<ShapesSummary>("shapes", "shapes"),
        DocumentSchema::of::<SimulationSummary>("simulation", "simulate"),
        DocumentSchema::of::<TaskList>("tasks", "tasks"),
    ]
}
