//! Forward model, which computes a trajectory from the parameters of a base law and its effects in an apparatus.

mod compliance;
mod composition;
mod convolution;
mod forward;
mod response;
mod sum_of_squares;

pub use compliance::Compliance;
pub use composition::Model;
pub use convolution::convolve_m;
pub use forward::{Forward, FullOrderForward, FullRun, SurrogateForward, TrainedRange};
pub use response::{Lanes, N_LANES, Response};
pub use sum_of_squares::{CreepLanes, ResidualSumOfSquares};
