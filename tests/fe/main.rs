//! Finite elements under models: exact stiffnesses, bodies off the centre, effects of the displacement field.

mod exact;
mod mesh_shapes;
mod off_centre;
mod spatial;
mod stepping;
