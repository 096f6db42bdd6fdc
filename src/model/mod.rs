//! Base law and apparatus combined into a forward model: parameters → trajectory.

mod composition;
mod convolution;
mod forward;
mod response;
mod sensitivity;
mod sum_of_squares;

pub use composition::Model;
pub use convolution::convolve_m;
pub use forward::{Forward, FullForward, ReducedForward, TrainedRange};
pub use response::{Lanes, N_LANES, Response};
pub use sensitivity::log_sensitivities_m;
pub use sum_of_squares::{CreepLanes, SumOfSquares};
