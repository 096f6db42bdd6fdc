//! Finite elements and meshes against closed forms, manufactured solutions and each other.

#[path = "../closed_forms/mod.rs"]
mod closed_forms;
mod exact;
mod gmsh_import;
mod manufactured;
mod meridional;
mod mesh_shapes;
mod off_centre;
mod patch;
mod poroelastic;
mod shapes;
mod spatial;
mod spheroids;
mod stepping;
mod tetrahedra;
mod time;
