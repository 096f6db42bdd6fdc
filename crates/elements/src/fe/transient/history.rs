//! Fields of a law's bodies, and their contributions to the current stage.

use nalgebra::Complex;

use super::ChainLaw;
use super::stages::{DIAGONAL, N_STAGES, predict};

/// A chain of bodies that all carry the stress w (Pa·m). Their strains (fields in m) add up to z.
pub(super) struct Chain {
    bodies: Vec<HistoryBody>,
    turning: Vec<Turning>,
}

struct HistoryBody {
    kind: HistoryKind,
    history: History,
}

/// A body with a complex variable y that obeys y' = λ (a w − y). Its strain is the real part of y.
struct Turning {
    /// Compliance a in 1/Pa.
    compliance_per_pa: Complex<f64>,
    /// Rate λ in 1/s.
    rate_per_s: Complex<f64>,
    /// Histories of the real and the imaginary part of y.
    histories: [History; 2],
}

struct History {
    /// Strain at the step's start, in m.
    strain_m: Vec<f64>,
    /// Rates at the stages, in m/s.
    rates_m_per_s: Vec<Vec<f64>>,
    /// Strain at the current stage minus γΔt times its rate, in m.
    predicted_m: Vec<f64>,
}

#[derive(Debug, Clone, Copy)]
enum HistoryKind {
    /// Kelvin–Voigt body with compliance a and retardation time τ: τ ε̇ + ε = a w.
    Retarded { compliance_per_pa: f64, time_s: f64 },
    /// Dashpot with fluidity φ: ε̇ = φ w.
    Flow { fluidity_per_pa_s: f64 },
    /// Spring with compliance J₀: ε = J₀ w.
    Spring { compliance_per_pa: f64 },
}

impl HistoryKind {
    /// Coefficients of the rate at a stage: ε̇ = first · w − second · (predicted strain). They are
    /// in 1/(Pa·s) and 1/s.
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

impl History {
    fn new(n_unknowns: usize) -> Self {
        Self {
            strain_m: vec![0.0; n_unknowns],
            rates_m_per_s: vec![vec![0.0; n_unknowns]; N_STAGES],
            predicted_m: vec![0.0; n_unknowns],
        }
    }

    fn predict(&mut self, stage: usize, step_s: f64) {
        predict(stage, step_s, &self.strain_m, &self.rates_m_per_s, &mut self.predicted_m);
    }

    /// Ends a step: the strain at its last stage becomes the strain at the start of the next step.
    fn end(&mut self, stage: usize, implicit_s: f64) {
        if stage + 1 == N_STAGES {
            let rates = &self.rates_m_per_s[stage];
            for ((strain, rate), predicted) in self.strain_m.iter_mut().zip(rates).zip(&self.predicted_m) {
                *strain = predicted + implicit_s * rate;
            }
        }
    }
}

impl Turning {
    /// λ/(1 + γΔt λ). At a stage y' is this factor times (a w − predicted y).
    fn stiff_rate(&self, implicit_s: f64) -> Complex<f64> {
        self.rate_per_s / (self.rate_per_s * implicit_s + 1.0)
    }
}

/// Response of a chain at a stage per unit stress: rate c, and strain j = γΔt c.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Response {
    pub rate_per_pa_s: f64,
    pub compliance_per_pa: f64,
}

/// Strain h (m) and rate g (m/s) of a chain at a stage for zero stress.
#[derive(Debug, Clone)]
pub(super) struct Free {
    pub strain_m: Vec<f64>,
    pub rate_m_per_s: Vec<f64>,
}

impl Free {
    pub fn new(n_unknowns: usize) -> Self {
        Self { strain_m: vec![0.0; n_unknowns], rate_m_per_s: vec![0.0; n_unknowns] }
    }
}

impl Chain {
    /// Builds the chain of a law, at rest.
    pub fn new(law: &ChainLaw, n_unknowns: usize) -> Self {
        let ChainLaw { bodies: law, oscillating: turning } = law;
        let retarded = law
            .retarded
            .iter()
            .map(|mode| HistoryKind::Retarded { compliance_per_pa: mode.compliance_per_pa, time_s: mode.time_s });
        let flow = Some(law.fluidity_per_pa_s).filter(|&fluidity| fluidity != 0.0);
        let spring = Some(law.instantaneous_per_pa).filter(|&compliance| compliance != 0.0);
        let kinds = retarded
            .chain(flow.map(|fluidity_per_pa_s| HistoryKind::Flow { fluidity_per_pa_s }))
            .chain(spring.map(|compliance_per_pa| HistoryKind::Spring { compliance_per_pa }));
        let body = |kind| HistoryBody { kind, history: History::new(n_unknowns) };
        let complex = |[re, im]: [f64; 2]| Complex::new(re, im);
        let turning = turning.iter().map(|mode| Turning {
            compliance_per_pa: complex(mode.compliance_per_pa),
            rate_per_s: complex(mode.rate_per_s),
            histories: [History::new(n_unknowns), History::new(n_unknowns)],
        });
        Self { bodies: kinds.map(body).collect(), turning: turning.collect() }
    }

    /// Response at a stage of a step. It is equal for all stages.
    pub(super) fn response(&self, step_s: f64) -> Response {
        let implicit_s = DIAGONAL * step_s;
        let of_bodies: f64 = self.bodies.iter().map(|body| body.kind.rate(implicit_s)[0]).sum();
        let turning = self.turning.iter().map(|body| (body.stiff_rate(implicit_s) * body.compliance_per_pa).re);
        let rate_per_pa_s = of_bodies + turning.sum::<f64>();
        Response { rate_per_pa_s, compliance_per_pa: implicit_s * rate_per_pa_s }
    }

    /// Begins a stage: computes strain and rate for zero stress.
    pub(super) fn begin_stage(&mut self, stage: usize, step_s: f64, free: &mut Free) {
        let implicit_s = DIAGONAL * step_s;
        free.strain_m.fill(0.0);
        free.rate_m_per_s.fill(0.0);
        for body in &mut self.bodies {
            body.history.predict(stage, step_s);
            let [_, back] = body.kind.rate(implicit_s);
            // 1 − back · γΔt, in a form without cancellation.
            let kept = match body.kind {
                HistoryKind::Retarded { time_s, .. } => time_s * back,
                HistoryKind::Flow { .. } => 1.0,
                HistoryKind::Spring { .. } => 0.0,
            };
            for ((strain, rate), predicted) in
                free.strain_m.iter_mut().zip(&mut free.rate_m_per_s).zip(&body.history.predicted_m)
            {
                *strain += kept * predicted;
                *rate -= back * predicted;
            }
        }
        for body in &mut self.turning {
            let back = body.stiff_rate(implicit_s);
            let kept = back / body.rate_per_s;
            body.histories.iter_mut().for_each(|history| history.predict(stage, step_s));
            let [re, im] = &body.histories;
            let places = free.strain_m.iter_mut().zip(&mut free.rate_m_per_s);
            for ((strain, rate), (re, im)) in places.zip(re.predicted_m.iter().zip(&im.predicted_m)) {
                *strain += kept.re * re - kept.im * im;
                *rate -= back.re * re - back.im * im;
            }
        }
    }

    /// Ends a stage, given its stress `stress_pa_m` (Pa·m).
    pub(super) fn end_stage(&mut self, stage: usize, step_s: f64, stress_pa_m: &[f64]) {
        let implicit_s = DIAGONAL * step_s;
        for body in &mut self.bodies {
            let [response, back] = body.kind.rate(implicit_s);
            let history = &mut body.history;
            let rates = history.rates_m_per_s[stage].iter_mut();
            for ((rate, w), predicted) in rates.zip(stress_pa_m).zip(&history.predicted_m) {
                *rate = response * w - back * predicted;
            }
            history.end(stage, implicit_s);
        }
        for body in &mut self.turning {
            let back = body.stiff_rate(implicit_s);
            let response = back * body.compliance_per_pa;
            let [re, im] = &mut body.histories;
            let rates = re.rates_m_per_s[stage].iter_mut().zip(&mut im.rates_m_per_s[stage]);
            let predicted = re.predicted_m.iter().zip(&im.predicted_m);
            for (((rate_re, rate_im), w), (p_re, p_im)) in rates.zip(stress_pa_m).zip(predicted) {
                *rate_re = response.re * w - (back.re * p_re - back.im * p_im);
                *rate_im = response.im * w - (back.re * p_im + back.im * p_re);
            }
            re.end(stage, implicit_s);
            im.end(stage, implicit_s);
        }
    }
}
