//! Learning a constitutive correction from data: a function by which a quantity depends on a state.
//!
//! Quantities are the force, an element's modulus or viscosity, and the observed position. States are position, path, time and others (physics §5.3). Every pair of a
//! quantity and a state is an effect like those of the library. It multiplies the quantity by e^{g(state)}, with a smooth function g that has a Gaussian prior about 0.
//! The pair is fitted together with law and noise. Its evidence is compared with that of searches in simulated data. Its prediction of unseen cycles is scored as in a
//! diagnosis. The result is written as a formula, in a file that defines an effect.

mod creep;
mod distil;
mod drawn;
mod fit;
mod formulas;
mod function;
mod job;
mod pairs;
pub mod record;
mod search;
mod smooth;
mod truncated;
mod words;

pub use distil::FILE_NAME;
pub use job::{LearningResult, learn, preview_learning};
pub use search::{
    EQUAL_NATS, FORMULA_LOSS, FORMULA_LOSS_NATS, LARGEST_P, LEAST_EVIDENCE_NATS, LEAST_FUTURE_NATS, Request,
};
pub use words::quantity_words;

#[cfg(test)]
#[expect(dead_code, reason = "tests of criticism use the rest")]
#[path = "../../criticism/src/test_subjects.rs"]
pub(crate) mod test_subjects;
