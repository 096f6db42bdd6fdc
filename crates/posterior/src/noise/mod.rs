//! Noise models: the difference between the predicted and the measured position (physics §5).
//!
//! The position yᵢ that is observed at row i of cycle c, for a predicted position xᵢ, is
//!
//!   yᵢ = xᵢ (1 + g_c) + o_c + u(tᵢ) + eᵢ
//!
//! | name | adds | parameters |
//! |---|---|---|
//! | `white` | independent errors eᵢ ~ N(0, σ²); every model has this term | `noise_sd_um` σ |
//! | `ou` | u, a stationary Ornstein–Uhlenbeck process of variance σ_ou² and correlation exp(−Δt/τ), which continues through cycles and gaps | `ou_sd_um` σ_ou, `ou_time_s` τ |
//! | `gain` | a gain g_c ~ N(0, s_g²) and an offset o_c ~ N(0, s_o²), independent for each cycle | `gain_sd` s_g, `offset_sd_um` s_o |
//! | `student` | Student-t errors instead of normal ones | `student_dof` ν |
//!
//! All terms are nuisances: they are learnt from the data, and no physical claim follows from them.
//!
//! # Cost
//! The density is the product of one-step predictive densities. A Kalman filter over (u, g, o) computes them exactly for any sampling times. The time is proportional
//! to the number of observations. The filter stores the covariance as U D Uᵀ (Bierman, *Factorization Methods for Discrete Sequential Estimation*, 1977, ch. V). The
//! covariance thus stays positive and keeps its digits, even if gain, offset and process are each large and their sum is small.
//!
//! # Student-t
//! With `student` the prediction is a t distribution. Given the past, yᵢ ~ t_ν(mᵢ, scale √Sᵢ), where mᵢ and Sᵢ are the filter's mean and variance. The state moves by K
//! w v instead of K v. Here K is the Kalman gain, v = yᵢ − mᵢ is the innovation, and w is the weight
//!
//!   w = (ν + 1)/(ν + v²/Sᵢ)
//!
//! so that an outlier moves the state little. The score ∂ln p(yᵢ)/∂mᵢ of the t distribution is w v/S. The state thus moves by P hᵀ times the score. This is a
//! *score-driven* filter (Harvey, *Dynamic Models for Volatility and Heavy Tails*, Cambridge University Press 2013; Harvey & Luati, *JASA* 109, 1112, 2014,
//! doi:10.1080/01621459.2014.887011, who leave out the score's factor (ν + 1)/ν).
//!
//! Any filter whose mᵢ and Sᵢ depend only on the past gives a proper joint density, since each factor integrates to one. As ν → ∞, the filter becomes the Kalman
//! filter. With `white` alone the errors are independent and t-distributed.
//!
//! With `student`, σ is the *scale* of the t distribution. The variance of a single error is σ² ν/(ν − 2). It is infinite at ν = 2, the end of the support. The linear
//! cost has a drawback: the t density depends on the choice of observed rows. The model of fewer rows is not the marginal of the model of all rows. For the Gaussian
//! terms, the two models agree.

mod filter;
mod lanes;
mod learning;
mod learnt_term;
mod likelihood;
mod model;
mod paths;
mod pointwise;
mod residuals;
mod rows;
mod scales;
mod slopes;
mod terms;
mod whitening;

#[cfg(test)]
mod dense_for_tests;

pub use lanes::LANES;
pub use learning::{NoiseLearning, NoiseValues};
pub use learnt_term::{DrawRow, LearningPrior, LearntParameter, NoiseBounds, NoiseKnowledge, RowShare};
pub use likelihood::{NoiseLikelihood, SharedPosition};
pub use model::NoiseModel;
pub use pointwise::Conditional;
pub use scales::NoiseScales;
pub use whitening::{CycleProducts, ProductRequest, Whitening, dot};
