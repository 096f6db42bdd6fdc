//! Full-order finite elements (physics §3): elements, assembly, factorisation, time stepping.

pub mod assembly;
pub mod element;
pub mod exact;
pub mod factorisation;
pub mod meridional;
pub mod ordering;
mod quadrature;
pub mod quality;
pub mod stepping;
pub mod strain;
pub mod surface;
pub mod time;

pub use assembly::{Assembly, Unknowns};
pub use factorisation::{Factor, Stiffness};
