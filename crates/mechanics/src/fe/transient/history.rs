//! The fields that a law's bodies keep, and what they say of the stage under way.

use super::stages::{DIAGONAL, N_STAGES, predict};
use crate::rheology::CreepCompliance;

/// A chain of bodies that all carry the stress w; their strains (fields in m, w in Pa·m) add up to z.
pub(super) struct Chain {
    bodies: Vec<Body>,
}

struct Body {
    kind: Kind,
    /// Strain at the step's start, in m.
    strain_m: Vec<f64>,
    /// Rates at the stages, in m/s.
    rates_m_per_s: Vec<Vec<f64>>,
    /// Strain at the stage under way, less γΔt times its rate.
    predicted_m: Vec<f64>,
}

#[derive(Debug, Clone, Copy)]
enum Kind {
    /// τ ε̇ + ε = a w.
    Retarded { compliance_per_pa: f64, time_s: f64 },
    /// ε̇ = φ w.
    Flow { fluidity_per_pa_s: f64 },
    /// ε = J₀ w.
    Spring { compliance_per_pa: f64 },
}

impl Kind {
    /// ε̇ at a stage is first · w − second · (predicted strain), both in 1/s but for the stress.
    fn rate(self, implicit_s: f64) -> [f64; 2] {
        match self {
            Self::Retarded { compliance_per_pa, time_s } => {
                let inverse = (time_s + implicit_s).recip();
                [compliance_per_pa * inverse, inverse]
            }
            Self::Flow { fluidity_per_pa_s } => [fluidity_per_pa_s, 0.0],
            Self::Spring { compliance_per_pa } => [compliance_per_pa / implicit_s, implicit_s.recip()],
        }
    }
}

/// c and j = γΔt c of a chain: rate and strain at a stage per unit stress.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Response {
    pub rate_per_pa_s: f64,
    pub compliance_per_pa: f64,
}

/// h and g: strain (m) and rate (m/s) at the stage if the stress were zero.
#[derive(Debug, Clone)]
pub(super) struct Free {
    pub strain_m: Vec<f64>,
    pub rate_m_per_s: Vec<f64>,
}

impl Free {
    pub(super) fn new(n_unknowns: usize) -> Self {
        Self { strain_m: vec![0.0; n_unknowns], rate_m_per_s: vec![0.0; n_unknowns] }
    }
}

impl Chain {
    /// The chain of a law, at rest.
    pub(super) fn new(law: &CreepCompliance, n_unknowns: usize) -> Self {
        let retarded = law
            .retarded
            .iter()
            .map(|mode| Kind::Retarded { compliance_per_pa: mode.compliance_per_pa, time_s: mode.time_s });
        let flow = Some(law.fluidity_per_pa_s).filter(|&fluidity| fluidity != 0.0);
        let spring = Some(law.instantaneous_per_pa).filter(|&compliance| compliance != 0.0);
        let kinds = retarded
            .chain(flow.map(|fluidity_per_pa_s| Kind::Flow { fluidity_per_pa_s }))
            .chain(spring.map(|compliance_per_pa| Kind::Spring { compliance_per_pa }));
        let body = |kind| Body {
            kind,
            strain_m: vec![0.0; n_unknowns],
            rates_m_per_s: vec![vec![0.0; n_unknowns]; N_STAGES],
            predicted_m: vec![0.0; n_unknowns],
        };
        Self { bodies: kinds.map(body).collect() }
    }

    /// Response at the stages of a step; all stages have the same.
    pub(super) fn response(&self, step_s: f64) -> Response {
        let implicit_s = DIAGONAL * step_s;
        let rate_per_pa_s: f64 = self.bodies.iter().map(|body| body.kind.rate(implicit_s)[0]).sum();
        Response { rate_per_pa_s, compliance_per_pa: implicit_s * rate_per_pa_s }
    }

    /// Prepares a stage: what strain and rate would be without stress.
    pub(super) fn begin_stage(&mut self, stage: usize, step_s: f64, free: &mut Free) {
        let implicit_s = DIAGONAL * step_s;
        free.strain_m.fill(0.0);
        free.rate_m_per_s.fill(0.0);
        for body in &mut self.bodies {
            predict(stage, step_s, &body.strain_m, &body.rates_m_per_s, &mut body.predicted_m);
            let [_, back] = body.kind.rate(implicit_s);
            // 1 − back · γΔt without cancellation.
            let kept = match body.kind {
                Kind::Retarded { time_s, .. } => time_s * back,
                Kind::Flow { .. } => 1.0,
                Kind::Spring { .. } => 0.0,
            };
            for ((strain, rate), predicted) in
                free.strain_m.iter_mut().zip(&mut free.rate_m_per_s).zip(&body.predicted_m)
            {
                *strain += kept * predicted;
                *rate -= back * predicted;
            }
        }
    }

    /// Ends a stage at which the stress was `stress_pa_m`.
    pub(super) fn end_stage(&mut self, stage: usize, step_s: f64, stress_pa_m: &[f64]) {
        let implicit_s = DIAGONAL * step_s;
        for body in &mut self.bodies {
            let [response, back] = body.kind.rate(implicit_s);
            let rates = &mut body.rates_m_per_s[stage];
            for ((rate, w), predicted) in rates.iter_mut().zip(stress_pa_m).zip(&body.predicted_m) {
                *rate = response * w - back * predicted;
            }
            if stage + 1 == N_STAGES {
                for ((strain, rate), predicted) in body.strain_m.iter_mut().zip(&*rates).zip(&body.predicted_m) {
                    *strain = predicted + implicit_s * rate;
                }
            }
        }
    }
}
