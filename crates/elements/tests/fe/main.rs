//! Tests of finite elements and meshes against closed forms, manufactured solutions and alternative
//! methods.

extern crate vitreo_uq_elements as elements;

#[path = "../../../../tests/closed_forms/mod.rs"]
mod closed_forms;
mod gmsh_import;
mod manufactured;
mod meridional;
mod patch;
mod poroelastic;
mod shapes;
mod spheroids;
mod tetrahedra;
mod time;
