//! `workbench`: a local web page that turns a record into a model, with the commands that are also available in a terminal.
//!
//! The only state are files on disk: the experiments and studies in one folder, the *home*. The page starts the program's commands as separate processes. It
//! shows the documents that they write.

mod choice;
mod home;
mod jobs;
mod link;
mod process;
mod project;
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
use crate::interrupt::print_message;
pub use home::FOLDER_VARIABLE;
use home::WorkbenchFolder;
use link::Link;

const USUAL_PORT: u16 = 8421;

/// Arguments of `workbench`.
#[derive(Args)]
pub struct WorkbenchArguments {
    /// Experiment or study to open, or a folder of them [default: this folder]
    #[arg(value_name = "EXPERIMENT|STUDY|FOLDER")]
    target: Option<PathBuf>,
    /// Port; 0 for any free port [default: that of the folder's last workbench, or 8421]
    #[arg(long, value_name = "N")]
    port: Option<u16>,
    /// Address to listen on, if other machines need the page; anyone with its link can run commands here
    #[arg(long, value_name = "ADDRESS", default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST))]
    listen: IpAddr,
    /// Further host name that requests may use, besides addresses, localhost and this machine's name; may be repeated
    #[arg(long, value_name = "NAME")]
    allow_host: Vec<String>,
    /// Do not open the page in a browser; the program never opens it, so this option has no effect
    #[arg(long)]
    no_open: bool,
    /// Print only the link, on standard output
    #[arg(long)]
    quiet: bool,
}

pub fn run(arguments: &WorkbenchArguments) -> Result<ExitCode> {
    let (home, item) = WorkbenchFolder::of(arguments.target.as_deref().unwrap_or(Path::new(".")))?;
    // Only on this machine: a link that was sent in clear over a network is not used again.
    let before = arguments.listen.is_loopback().then(|| Link::read(home.dir())).flatten();
    // The port of the folder's last workbench comes first. If other programs use it and the usual port, any free port is taken.
    let ports = match arguments.port {
        None | Some(0) => {
            before.iter().map(|link| link.port).chain([arguments.port.unwrap_or(USUAL_PORT), 0]).collect()
        }
        Some(port) => vec![port],
    };
    let (listener, address) = crate::http::listen(arguments.listen, &ports)?;
    // At another port the token is new: whoever took the old port has seen the token in the requests of open pages.
    let token = before.filter(|link| link.port == address.port()).map_or_else(token, |link| Ok(link.token))?;
    if address.ip().is_loopback() {
        Link { port: address.port(), token: token.clone() }.store(home.dir());
    }
    let link = format!(
        "http://{address}/{token}/{}",
        item.map_or(String::new(), |item| format!("#{}", percent_encoded(&item)))
    );
    if !arguments.quiet {
        print_message(&format!("Workbench of {}; Ctrl-C ends it and its running command.", home.dir().display()));
        if !address.ip().is_loopback() {
            print_message("note: other machines can reach this page; anyone with its link can run commands here");
        }
        print_message("Open this link in a browser:");
    }
    crate::output::print(&format!("{link}\n"))?;
    server::run(listener, home, token, Guard::new(address, &arguments.allow_host))?;
    Ok(ExitCode::SUCCESS)
}

/// A name as the page reads it from its address.
fn percent_encoded(name: &str) -> String {
    let encoded = |byte: u8| match byte {
        b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'-' | b'_' | b'.' | b'/' => char::from(byte).to_string(),
        _ => format!("%{byte:02X}"),
    };
    name.bytes().map(encoded).collect()
}

/// Returns a random token of 128 bits in hexadecimal digits, which nobody can guess.
fn token() -> Result<String> {
    let mut bytes = [0_u8; 16];
    getrandom::fill(&mut bytes).map_err(|error| {
        Error::numerical(
            format!("the operating system provides no random numbers: {error}"),
            "repair the operating system's random number generator",
        )
    })?;
    Ok(base::sha256::hex(&bytes))
}
