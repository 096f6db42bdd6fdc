//! Strain histories of a law's bodies, and their contributions to a stage of a time step.

use nalgebra::Complex;

use super::ChainLaw;
use super::stages::{DIAGONAL, N_STAGES, predict};

/// A law as a chain of bodies in series: all bear one stress field (Pa·m), and their strain fields
/// (m) add up to the unknowns.
pub(super) struct Chain {
    bodies: Vec<HistoryBody>,
    turning: Vec<OscillatingBody>,
}

struct HistoryBody {
    kind: HistoryKind,
    history: History,
}

/// A body with a complex strain y that obeys y' = λ (a w − y) under the stress w. Its real strain
/// is the real part of y.
struct OscillatingBody {
    /// Complex compliance a of the body, in 1/Pa.
    compliance_per_pa: Complex<f64>,
    /// Complex rate λ of the body, in 1/s.
    rate_per_s: Complex<f64>,
    /// Histories of the real and the imaginary part of the complex strain.
    histories: [History; 2],
}

struct History {
    /// Strain at the step's start, in m.
    strain_m: Vec<f64>,
    /// Strain rates at the stages of the step, in m/s.
    rates_m_per_s: Vec<Vec<f64>>,
    /// Strain at the current stage without the implicit contribution of the stage's own rate, in m.
    predicted_m: Vec<f64>,
}

#[derive(Debug, Clone, Copy)]
enum HistoryKind {
    /// Kelvin–Voigt body: its strain approaches compliance × stress within the retardation time.
    Retarded { compliance_per_pa: f64, time_s: f64 },
    /// Dashpot: its strain rate is fluidity × stress.
    Flow { fluidity_per_pa_s: f64 },
    /// Spring: its strain is compliance × stress.
    Spring { compliance_per_pa: f64 },
}

impl HistoryKind {
    /// Coefficients of the strain rate at a stage: rate = first · stress − second · predicted
    /// strain. Their units are 1/(Pa·s) and 1/s. `implicit_s` is the stage's implicit time
    /// (diagonal coefficient × step length).
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

    /// Stores the strain at the end of the last stage as the start of the next step. Does nothing
    /// at earlier stages.
    fn end(&mut self, stage: usize, implicit_s: f64) {
        if stage + 1 == N_STAGES {
            let rates = &self.rates_m_per_s[stage];
            for ((strain, rate), predicted) in self.strain_m.iter_mut().zip(rates).zip(&self.predicted_m) {
                *strain = predicted + implicit_s * rate;
            }
        }
    }
}

impl OscillatingBody {
    /// Returns λ/(1 + λ `implicit_s`) for the body's complex rate λ. At a stage, the rate of the
    /// complex strain is this factor times (compliance × stress − predicted strain).
    fn implicit_rate_per_s(&self, implicit_s: f64) -> Complex<f64> {
        self.rate_per_s / (self.rate_per_s * implicit_s + 1.0)
    }
}

/// Response of a chain of bodies to unit stress at a stage: strain rate and strain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Response {
    pub rate_per_pa_s: f64,
    pub compliance_per_pa: f64,
}

/// Strain (m) and strain rate (m/s) of a chain of bodies at a stage, if its stress were zero.
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
        let turning = turning.iter().map(|mode| OscillatingBody {
            compliance_per_pa: complex(mode.compliance_per_pa),
            rate_per_s: complex(mode.rate_per_s),
            histories: [History::new(n_unknowns), History::new(n_unknowns)],
        });
        Self { bodies: kinds.map(body).collect(), turning: turning.collect() }
    }

    /// Strain rate and strain of the chain per unit stress at a stage. They are equal for all
    /// stages of a step.
    pub(super) fn response(&self, step_s: f64) -> Response {
        let implicit_s = DIAGONAL * step_s;
        let of_bodies: f64 = self.bodies.iter().map(|body| body.kind.rate(implicit_s)[0]).sum();
        let turning =
            self.turning.iter().map(|body| (body.implicit_rate_per_s(implicit_s) * body.compliance_per_pa).re);
        let rate_per_pa_s = of_bodies + turning.sum::<f64>();
        Response { rate_per_pa_s, compliance_per_pa: implicit_s * rate_per_pa_s }
    }

    /// Begins a stage: computes the chain's strain and rate for zero stress.
    pub(super) fn begin_stage(&mut self, stage: usize, step_s: f64, free: &mut Free) {
        let implicit_s = DIAGONAL * step_s;
        free.strain_m.fill(0.0);
        free.rate_m_per_s.fill(0.0);
        for body in &mut self.bodies {
            body.history.predict(stage, step_s);
            let [_, back] = body.kind.rate(implicit_s);
            // `kept` is 1 − back · implicit_s, in a form without cancellation.
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
            let back = body.implicit_rate_per_s(implicit_s);
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

    /// Ends a stage: computes the rates of all bodies from the stage's stress `stress_pa_m` (Pa·m).
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
            let back = body.implicit_rate_per_s(implicit_s);
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
