//! A law that another program computes: its parameters are declared, its equations are not known here (formats §2).

use std::sync::{Mutex, PoisonError};

use crate::distribution::Distribution;
use crate::parameter::{ParameterSpec, Support};

/// Every such law that has been read.
static LAWS: Mutex<Vec<&'static OutsideLaw>> = Mutex::new(Vec::new());

/// A parameter as a file declares it.
#[derive(Debug, Clone, PartialEq)]
pub struct Declared {
    /// Name.
    pub name: String,
    /// Unit in which the other program takes it.
    pub unit: String,
    /// Where it may lie.
    pub support: Support,
    /// Its prior.
    pub prior: Distribution,
}

/// A law that another program computes.
#[derive(Debug, PartialEq)]
pub struct OutsideLaw {
    url: String,
    model: String,
    declared: Vec<Declared>,
    parameters: Vec<ParameterSpec>,
}

impl OutsideLaw {
    /// A law whose model answers at a URL; the same law is the same reference.
    ///
    /// A law is copied into every forward model and thread, and parameters' names are static everywhere: like a network, it lives as long as the program.
    pub fn new(url: &str, model: &str, declared: &[Declared]) -> &'static Self {
        let mut laws = LAWS.lock().unwrap_or_else(PoisonError::into_inner);
        let is_it = |law: &&&'static Self| law.url == url && law.model == model && law.declared == declared;
        if let Some(known) = laws.iter().find(is_it) {
            return known;
        }
        let leak = |text: &str| -> &'static str { Box::leak(text.to_string().into_boxed_str()) };
        let spec = |own: &Declared| ParameterSpec::new(leak(&own.name), "", leak(&own.unit), own.support);
        let parameters = declared.iter().map(spec).collect();
        let (url, model, declared) = (url.to_string(), model.to_string(), declared.to_vec());
        let law: &'static Self = Box::leak(Box::new(Self { url, model, declared, parameters }));
        laws.push(law);
        law
    }

    /// The parameter of a name that a law has declared, if one has.
    pub fn parameter_named(name: &str) -> Option<ParameterSpec> {
        let laws = LAWS.lock().unwrap_or_else(PoisonError::into_inner);
        laws.iter().flat_map(|law| &law.parameters).find(|spec| spec.name == name).copied()
    }

    /// The same law where its model answers at another URL.
    pub fn at(&self, url: &str) -> &'static Self {
        Self::new(url, &self.model, &self.declared)
    }

    /// Where its model answers; empty where nobody has said it yet.
    pub fn url(&self) -> &str {
        &self.url
    }

    /// Name of the model there.
    pub fn model(&self) -> &str {
        &self.model
    }

    /// Its parameters as they were declared, in the order in which the other program takes them.
    pub fn declared(&self) -> &[Declared] {
        &self.declared
    }

    /// Its parameters, in the same order.
    pub fn parameters(&self) -> &[ParameterSpec] {
        &self.parameters
    }

    /// The prior of one of its parameters, and where its numbers come from.
    pub(super) fn default_prior(&self, name: &str) -> Option<(Distribution, &'static str)> {
        let own = self.declared.iter().find(|own| own.name == name)?;
        Some((own.prior, "declared with the law"))
    }
}
