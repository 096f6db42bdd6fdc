//! `compare --laws`: fits several base laws to one record and compares their evidence and their errors on rows that no fit has seen.
//!
//! [`creep`] fits records over time, and [`oscillation`] fits tables of moduli. `ranking` orders the laws of both.

pub mod creep;
pub mod oscillation;
mod ranking;

use std::path::Path;

use base::error::Result;
use base::files::{self, to_json};
use base::quantities::Quantities;
use documents::laws::LawComparison;
use figures::svg::figure_files;
use laws::rheology::BaseLaw;
use posterior::monitor::Monitor;
use posterior::study::{LAWS_NAME, ModelSpecification, Study, WithProvenance};

use self::ranking::specification;
use crate::outcome::Outcome;
use crate::target::{ModelRequest, Target};

/// Settings of the comparison that the caller chooses.
pub struct LawsRequest {
    /// Names or files of the laws. An empty list selects all laws that have a name.
    pub laws: Vec<String>,
    /// Seed of the random numbers.
    pub seed: u64,
}

/// Compares base laws on one record by their evidence, or by their errors if none explains the record, and writes the comparison into the record's study. The laws have no effects.
/// All have the same priors of the noise, and wide priors of their parameters unless the target names a prior.
///
/// # Errors
/// [`base::error::Error::Input`] for several records, an unknown law or a prior that a law cannot use.
pub fn run(target: &Target, request: &LawsRequest, monitor: &dyn Monitor) -> Result<Outcome<LawComparison>> {
    let specifications = |model: &ModelRequest| -> Result<Vec<(String, ModelSpecification)>> {
        let names: Vec<String> = match request.laws.as_slice() {
            [] => BaseLaw::names().map(String::from).collect(),
            given => given.to_vec(),
        };
        names.into_iter().map(|name| Ok((name.clone(), specification(&name, model)?))).collect()
    };
    if let Target::Oscillation(target) = target {
        target.refuse_foreign_options()?;
        let body = oscillation::compare(&target.sweep, specifications(&target.request)?, request.seed, monitor)?;
        let found = write(&target.make_study()?, body, None, request.seed, monitor)?;
        // The page is one of a record over time.
        return Ok(Outcome { study: None, ..found });
    }
    let target = target.creep()?;
    target.check(monitor)?;
    let body = creep::compare(target, specifications(&target.request)?, request.seed, monitor)?;
    write(&target.make_study()?, body, target.experiment.quantities(), request.seed, monitor)
}

fn write(
    study: &Study,
    body: LawComparison,
    quantities: Option<Quantities>,
    seed: u64,
    monitor: &dyn Monitor,
) -> Result<Outcome<LawComparison>> {
    monitor.stage("writing results and figures");
    let provenance = study.provenance("laws", 1, seed).with_quantities(quantities);
    let is_sound = body.is_explained == Some(true);
    let document = WithProvenance { provenance, body };
    let [svg, png, pdf] =
        figure_files(study.dir(), "laws", &figures::laws::laws(&document.body).translated(quantities))?;
    let path = study.dir().join(LAWS_NAME);
    let json = (path.clone(), to_json(&path, &document)?);
    let all: [(&Path, &[u8]); 4] = [&svg, &png, &pdf, &json].map(|(path, bytes)| (path.as_path(), bytes.as_slice()));
    files::write_together(&all)?;
    let has_page = !study.revisions()?.is_empty();
    Ok(Outcome { is_sound, document, written: svg.0, study: has_page.then_some(study.clone()) })
}
