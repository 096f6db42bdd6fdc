//! Challenges with hidden effects, calibration of posteriors, and the study of robot shapes.

pub mod calibration;
pub mod challenge;
pub mod shapes;
