//! Meshes of the gel and full-order finite elements.

pub mod fe;
pub mod mesh;
