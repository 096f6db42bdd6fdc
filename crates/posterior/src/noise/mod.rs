//! Noise models: the difference between the predicted position and the tracker's (physics §5).
//!
//! The position observed at row i of cycle c is
//!
//!   yᵢ = xᵢ (1 + g_c) + o_c + u(tᵢ) + eᵢ
//!
//! | name | adds | parameters |
//! |---|---|---|
//! | `white` | independent eᵢ ~ N(0, σ²); compulsory | `noise_sd_um` σ |
//! | `ou` | u, a stationary Ornstein–Uhlenbeck process of variance σ_ou² and correlation exp(−Δt/τ), through cycles and gaps | `ou_sd_um` σ_ou, `ou_time_s` τ |
//! | `gain` | g_c ~ N(0, s_g²) and o_c ~ N(0, s_o²), independent for each cycle | `gain_sd` s_g, `offset_sd_um` s_o |
//! | `student` | heavy tails in place of normal ones | `student_dof` ν |
//!
//! All terms are nuisance: they are learnt from the data and never a physical claim.
//!
//! # Cost
//! The density is the product of one-step predictive densities. A Kalman filter over (u, g, o) gives them in time linear in the number of observations, exactly for any
//! times. The filter stores the covariance as U D Uᵀ (Bierman, *Factorization Methods for Discrete Sequential Estimation*, 1977, ch. V). The covariance thus stays positive
//! and keeps its digits if gain, offset and process are each large and their sum is small.
//!
//! # Student-t
//! With `student` the prediction is a t distribution: given the past, yᵢ ~ t_ν(mᵢ, scale √Sᵢ) with the filter's mean mᵢ and variance Sᵢ. The state moves by K w v instead
//! of K v, with the innovation v = yᵢ − mᵢ and the weight
//!
//!   w = (ν + 1)/(ν + v²/Sᵢ)
//!
//! so that an outlier moves it little. w v/S is the score ∂ln p(yᵢ)/∂mᵢ of the t, so the state moves by P hᵀ times the score. This is a *score-driven* filter (Harvey,
//! *Dynamic Models for Volatility and Heavy Tails*, Cambridge University Press 2013; Harvey & Luati, *JASA* 109, 1112, 2014, doi:10.1080/01621459.2014.887011, who leave
//! out the score's factor (ν + 1)/ν).
//!
//! Any filter whose mᵢ and Sᵢ are functions of the past alone gives a proper joint density, since each factor integrates to one. As ν → ∞ the filter becomes the Gaussian
//! one. With `white` alone the errors are independent and t-distributed.
//!
//! σ is then the *scale* of the t: the variance of a single error is σ² ν/(ν − 2), which is infinite at the support's end ν = 2. O(n) has a price: the t density belongs to
//! the observed rows. A model with fewer rows is a different model and not its marginal (for the Gaussian terms both are equal).

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
pub use learnt_term::{DrawRow, LearningPrior, LearntParameter, RowShare};
pub use likelihood::{NoiseLikelihood, SharedPosition};
pub use model::NoiseModel;
pub use pointwise::Conditional;
pub use scales::NoiseScales;
pub use whitening::{CycleProducts, ProductRequest, Whitening, dot};
