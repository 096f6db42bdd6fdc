//! Full-order finite elements (physics §3).

pub mod ordering;
