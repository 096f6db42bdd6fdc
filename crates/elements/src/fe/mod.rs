//! Full-order finite elements (physics §3): elements, assembly, factorisation, time stepping.

pub mod assembly;
pub mod clock;
pub mod element;
pub mod exact;
pub mod factorisation;
pub mod meridional;
pub mod nonlinear;
pub mod oldroyd;
pub mod ordering;
pub mod poroelastic;
mod quadrature;
pub mod quality;
pub mod spatial;
pub mod stepping;
pub mod strain;
pub mod surface;
pub mod time;
pub mod transient;

pub use assembly::{Assembly, Unknowns};
pub use factorisation::{Factor, Stiffness};
