//! `workbench`: a local page on which a record becomes a model, with the same commands as in a terminal.
//!
//! What is on disk is the state: experiments and studies in one folder, its *home*. The page starts the program's own commands, each a process of its own, and shows the documents that they write.

mod choice;
mod home;
mod jobs;
mod process;
mod rows;
mod server;
mod tables;
mod trial;

#[cfg(test)]
mod name_tests;

use std::net::{IpAddr, Ipv4Addr};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use vitreo_uq::base::error::{Error, Result};

use crate::guard::Guard;
use crate::interrupt::say;
pub use home::FOLDER_VARIABLE;
use home::Home;

const USUAL_PORT: u16 = 8421;

/// Arguments of `workbench`.
#[derive(Args)]
pub struct WorkbenchArguments {
    /// Experiment or study to open, or a folder of them [default: this folder]
    #[arg(value_name = "EXPERIMENT|STUDY|FOLDER")]
    target: Option<PathBuf>,
    /// Port; 0 for any that is free
    #[arg(long, value_name = "N", default_value_t = USUAL_PORT)]
    port: u16,
    /// Address to listen on, where others than this machine shall reach the page: whoever has its link may run commands here
    #[arg(long, value_name = "ADDRESS", default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST))]
    listen: IpAddr,
    /// A further name under which the page may be asked for, beside addresses, localhost and this machine's name; may be repeated
    #[arg(long, value_name = "NAME")]
    allow_host: Vec<String>,
    /// Do not open the page in a browser: the program never does, so that this changes nothing
    #[arg(long)]
    no_open: bool,
    /// Say the link alone on standard output
    #[arg(long)]
    quiet: bool,
}

pub fn run(arguments: &WorkbenchArguments) -> Result<ExitCode> {
    let (home, item) = Home::of(arguments.target.as_deref().unwrap_or(Path::new(".")))?;
    // Another workbench may have the usual port.
    let ports = if arguments.port == USUAL_PORT { vec![USUAL_PORT, 0] } else { vec![arguments.port] };
    let (listener, address) = crate::http::listen(arguments.listen, &ports)?;
    let token = token()?;
    let link = format!("http://{address}/{token}/{}", item.map_or(String::new(), |item| format!("#{item}")));
    if !arguments.quiet {
        say(&format!("Workbench of {}; Ctrl-C ends it, and what it had started.", home.dir().display()));
        if !address.ip().is_loopback() {
            say("note: other machines reach this page; whoever has its link may run commands here");
        }
        say("Open this link in a browser:");
    }
    crate::output::print(&format!("{link}\n"))?;
    server::run(listener, home, token, Guard::of(address, &arguments.allow_host))?;
    Ok(ExitCode::SUCCESS)
}

/// 128 bits that nobody guesses, in hexadecimal.
fn token() -> Result<String> {
    let mut bytes = [0_u8; 16];
    getrandom::fill(&mut bytes).map_err(|error| {
        Error::numerical(format!("the system gives no random numbers: {error}"), "look after the system")
    })?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}
