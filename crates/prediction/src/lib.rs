//! Prediction under uncertainty: the motion of a robot in a gel whose parameters are known as draws, its sensitivity, and force plans.
//!
//! [`scenario_file`] reads robots, gels and forces. [`ensemble`] turns the draws of a model into trajectories, and checks some by full finite elements.
//! [`quantity`] takes quantities of interest from trajectories, [`sensitivity`] attributes their variance, and [`plan`] searches for forces.
//! [`free_path`] tells where a robot touches the outer surface of the gel.
//! [`tolerance`] scales trajectories by uncertain sizes, places and forces.
//! [`shapes`] judges the paper's claims about robots of several shapes.
//! [`robot_size`] searches for the largest robot of a shape and for the smallest magnet that reach a target.

pub mod body;
pub mod ensemble;
pub mod force_history;
mod force_times;
pub mod free_path;
pub mod plan;
pub mod quantity;
pub mod robot_size;
pub mod scenario;
pub mod scenario_file;
pub mod sensitivity;
pub mod shapes;
pub mod tolerance;
