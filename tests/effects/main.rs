//! Effects: what every one of them must hold, and whether they are found again.

mod conformance;
mod kernels;
mod recovery;
mod visibility;
