//! Asks the user questions at the terminal.

use std::io::{IsTerminal, Write};
use std::path::Path;

use vitreo_uq::record::table::Question;

/// Returns whether questions can be asked. Input and output must be terminals, and neither `--quiet` nor `--json -` may be given.
pub fn can_ask_questions(quiet: bool, json: Option<&Path>) -> bool {
    let is_read_by_a_program = json == Some(Path::new("-"));
    !quiet && !is_read_by_a_program && std::io::stdin().is_terminal() && std::io::stderr().is_terminal()
}

/// Asks a question until the answer is allowed. Returns `None` at the end of the input.
pub fn ask(question: &Question) -> Option<String> {
    answer(question, &mut std::io::stdin().lock(), &mut std::io::stderr().lock())
}

fn answer(question: &Question, input: &mut dyn std::io::BufRead, output: &mut dyn Write) -> Option<String> {
    let Question { text, choices, also, proposal } = question;
    let choices_said = if choices.is_empty() { String::new() } else { format!(" ({})", choices.join(", ")) };
    let proposed = proposal.as_ref().map_or(String::new(), |proposal| format!(" [{proposal}]"));
    loop {
        write!(output, "{text}{choices_said}{proposed}: ").and_then(|()| output.flush()).ok()?;
        let mut line = String::new();
        if input.read_line(&mut line).ok()? == 0 {
            return None;
        }
        let said = line.trim();
        match proposal {
            Some(proposal) if said.is_empty() => return Some(proposal.clone()),
            _ if said.is_empty() => {}
            _ if choices.is_empty() || choices.iter().chain(also).any(|choice| choice == said) => {
                return Some(said.into());
            }
            _ => writeln!(output, "`{said}` is not one of the choices.").ok()?,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_answer_is_one_of_the_choices_or_the_proposal() {
        let choices = ["mN", "uN"].map(String::from).to_vec();
        let question = Question { text: "unit".into(), choices, also: vec!["1".into()], proposal: Some("uN".into()) };
        let answered = |typed: &str| {
            let mut shown = Vec::new();
            let said = answer(&question, &mut typed.as_bytes(), &mut shown);
            (said, String::from_utf8(shown).unwrap())
        };
        assert_eq!(answered("\n").0.as_deref(), Some("uN"));
        let (said, shown) = answered("kg\n mN \n");
        assert_eq!(said.as_deref(), Some("mN"));
        assert_eq!(shown, "unit (mN, uN) [uN]: `kg` is not one of the choices.\nunit (mN, uN) [uN]: ");
        assert_eq!(answered("1\n").0.as_deref(), Some("1"));
        assert_eq!(answered("").0, None);
    }
}
