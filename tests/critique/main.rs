//! Diagnosis and challenges.

mod challenge;
mod evidence;
mod outside;
