//! Meshes of the gel and full finite elements.

pub mod fe;
pub mod mesh;
