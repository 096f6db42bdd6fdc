//! Base law and apparatus combined into a forward model: parameters → trajectory.

mod compliance;
mod composition;
mod convolution;
mod forward;
mod sensitivity;
mod sum_of_squares;

pub use compliance::Compliance;
pub use composition::Model;
pub use convolution::convolve_m;
pub use forward::{Forward, FullForward, FullRun, ReducedForward, TrainedRange};
pub use sensitivity::log_sensitivities_m;
pub use sum_of_squares::{CreepLanes, SumOfSquares};
