//! Challenges with hidden effects, and calibration of posteriors.

pub mod calibration;
pub mod challenge;
