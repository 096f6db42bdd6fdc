//! Types of the JSON documents that commands write (formats §5), with a few queries for readers. Jobs create them; figures and the terminal show them.

pub mod calibration;
pub mod check;
pub mod cohort;
pub mod comparison;
pub mod design;
pub mod diagnosis;
pub mod effects;
pub mod errors;
pub mod extension;
pub mod fit;
pub mod groups;
pub mod init;
pub mod joint;
pub mod ladder;
pub mod laws;
pub mod learned;
pub mod learned_cohort;
pub mod oscillation;
pub mod posterior;
pub mod prediction;
pub mod shapes;
pub mod simulation;
pub mod tasks;
pub mod trust;
