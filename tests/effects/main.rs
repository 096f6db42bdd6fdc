//! Effects: properties of every effect, and their recovery from data.

mod conformance;
mod kernels;
mod recovery;
mod relaxation;
mod visibility;
