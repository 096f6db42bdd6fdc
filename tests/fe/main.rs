//! Finite elements under models: exact stiffnesses, bodies off the centre, effects of the displacement field.

#[path = "../closed_forms/mod.rs"]
mod closed_forms;
mod exact;
mod mesh_shapes;
mod off_centre;
mod spatial;
mod stepping;
