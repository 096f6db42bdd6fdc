//! `completions` and `man`: generate shell completions and manual pages from the definitions of the command line.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Command};
use clap_complete::Shell;
use vitreo_uq::base::error::{Error, Result};
use vitreo_uq::base::files::write_atomically;

/// Arguments of `completions`.
#[derive(Args)]
pub struct CompletionsArguments {
    /// Shell
    #[arg(value_name = "SHELL", value_enum)]
    shell: Shell,
}

/// Arguments of `man`.
#[derive(Args)]
pub struct ManArguments {
    /// Directory of the pages; one is written for the program and one for every command
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Do not print the path of the pages
    #[arg(long)]
    quiet: bool,
}

/// Prints the shell completions. `program` is the command-line parser.
pub fn completions(arguments: &CompletionsArguments, mut program: Command) -> Result<ExitCode> {
    let name = program.get_name().to_string();
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut program, name, &mut script);
    crate::output::print(&String::from_utf8_lossy(&script))?;
    Ok(ExitCode::SUCCESS)
}

/// Writes one manual page for the program, and one for each of its commands.
pub fn man(arguments: &ManArguments, program: Command) -> Result<ExitCode> {
    let out = &arguments.out;
    std::fs::create_dir_all(out).map_err(|error| Error::at_path("create", out, error, "give a writable directory"))?;
    let pages = pages(program)?;
    for (name, page) in &pages {
        write_atomically(&out.join(name), page)?;
    }
    if !arguments.quiet {
        crate::interrupt::print_message(&format!("{} pages: {}", pages.len(), out.display()));
    }
    Ok(ExitCode::SUCCESS)
}

/// Names and texts of all manual pages, including those of nested commands.
fn pages(program: Command) -> Result<Vec<(String, Vec<u8>)>> {
    let mut program = program.disable_help_subcommand(true);
    // This sets the full names of nested commands, and adds the program's global options to them.
    program.build();
    let mut left = vec![program];
    let mut pages = Vec::new();
    while let Some(command) = left.pop() {
        left.extend(command.get_subcommands().filter(|command| !command.is_hide_set()).cloned());
        let man = clap_mangen::Man::new(command);
        let (name, mut page) = (man.get_filename(), Vec::new());
        man.render(&mut page).map_err(|error| {
            Error::numerical(format!("{name} cannot be written: {error}"), "report the command that was run")
        })?;
        pages.push((name, page));
    }
    pages.sort();
    Ok(pages)
}
