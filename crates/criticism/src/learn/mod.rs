//! The law that nobody wrote down: which quantity depends on which state, and how, as the data have it.
//!
//! Every pair of a quantity (the force, an element's modulus or viscosity, the observed position) and a state (position, path, time and others, physics §5.3) is an effect like those
//! of the library: the quantity times e^{g(state)}, g a smooth function with a Gaussian prior about 0. It is fitted with law and noise together, and judged as
//! a diagnosis judges effects: by its evidence beside that of searches in simulated data, and by cycles that were not seen. What was learnt is written down as
//! a formula, in a file that is an effect.

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
pub use job::{Outcome, first_look, learn};
pub use search::{
    EQUAL_NATS, FORMULA_LOSS, FORMULA_LOSS_NATS, LARGEST_P, LEAST_EVIDENCE_NATS, LEAST_FUTURE_NATS, Request,
};
pub use words::quantity_words;
