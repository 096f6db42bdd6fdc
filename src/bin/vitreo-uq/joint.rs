//! Formats the result of `sample` for several records of one specimen as text.

use vitreo_uq::documents::joint::JointSummary;
use vitreo_uq::figures::labels::{model_title, parameter_label};

use crate::text::{parameter_table, significant, warning_text};

/// Text of the joint posterior of several records.
pub fn words(summary: &JointSummary) -> String {
    let verdict = if summary.converged { "converged" } else { "NOT CONVERGED" };
    let mut lines = vec![
        format!("{} records, one {} law: {verdict}", summary.records.len(), model_title(&summary.model)),
        String::new(),
        parameter_table(&summary.parameters),
        String::new(),
        "Each record fitted alone (best fit, one standard deviation):".into(),
    ];
    for (number, record) in summary.records.iter().enumerate() {
        let law: Vec<String> = record
            .law
            .iter()
            .map(|law_estimate| {
                let label = parameter_label(&law_estimate.name);
                let [value, lower, upper] =
                    [law_estimate.value, law_estimate.lower, law_estimate.upper].map(significant);
                format!("{} = {value} ({lower} to {upper}) {}", label.symbol, label.unit)
            })
            .collect();
        lines.push(format!("  record {}, {} ({}): {}", number + 1, record.kind, record.id, law.join(", ")));
    }
    let p = summary.agreement.p;
    let shown = if p < 0.001 { "below 0.001".into() } else { format!("{p:.3}") };
    lines.push(format!("Probability of a difference this large between records of one law: {shown}."));
    for warning in &summary.warnings {
        lines.push(String::new());
        lines.push(warning_text(warning));
    }
    lines.join("\n") + "\n"
}
