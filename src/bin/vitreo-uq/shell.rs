//! `completions` and `man`: what shells and `man` know of this program, made from the parser.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Command};
use clap_complete::Shell;
use vitreo_uq::error::{Error, Result};
use vitreo_uq::files::write_atomically;

/// Arguments of `completions`.
#[derive(Args)]
pub struct CompletionsArguments {
    /// The shell
    #[arg(value_name = "SHELL", value_enum)]
    shell: Shell,
}

/// Arguments of `man`.
#[derive(Args)]
pub struct ManArguments {
    /// Directory of the pages: one of the program, and one of every command
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Do not say where the pages went
    #[arg(long)]
    quiet: bool,
}

/// Prints the completions; `program` is the parser.
pub fn completions(arguments: &CompletionsArguments, mut program: Command) -> Result<ExitCode> {
    let name = program.get_name().to_string();
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut program, name, &mut script);
    crate::output::print(&String::from_utf8_lossy(&script))?;
    Ok(ExitCode::SUCCESS)
}

/// Writes a page for the program and for every command of it.
pub fn man(arguments: &ManArguments, program: Command) -> Result<ExitCode> {
    let out = &arguments.out;
    std::fs::create_dir_all(out)
        .map_err(|error| Error::at_path("create", out, error, "give a directory that can be written"))?;
    let pages = pages(program)?;
    for (name, page) in &pages {
        write_atomically(&out.join(name), page)?;
    }
    if !arguments.quiet {
        crate::interrupt::say(&format!("{} pages: {}", pages.len(), out.display()));
    }
    Ok(ExitCode::SUCCESS)
}

/// Names and texts of the pages, of commands within commands, too.
fn pages(mut program: Command) -> Result<Vec<(String, Vec<u8>)>> {
    // What `--help` would show: names of commands with those before them, and arguments that commands share.
    program.build();
    let mut left = vec![program];
    let mut pages = Vec::new();
    while let Some(command) = left.pop() {
        let inner = command.get_subcommands().filter(|own| own.get_name() != "help" && !own.is_hide_set());
        left.extend(inner.cloned());
        let name = command.get_display_name().unwrap_or(command.get_name()).to_string();
        let mut page = Vec::new();
        let man = clap_mangen::Man::new(command.name(name.clone()));
        man.render(&mut page).map_err(|error| {
            Error::numerical(format!("the page of {name} cannot be written: {error}"), "report the command that was run")
        })?;
        pages.push((format!("{name}.1"), page));
    }
    pages.sort();
    Ok(pages)
}
