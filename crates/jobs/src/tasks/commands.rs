//! Tasks that run commands of this program. The result of a task is the set of files that its command writes into the directory `{out}`.
//!
//! The list of commands is a text with one command per line, split into words as by a shell. Words that name files or directories are inputs, which are
//! identified by their content. Each command runs in its own process. `{out}` is a new empty directory for each command.

use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use serde::{Deserialize, Serialize};
use serde_json::json;

use super::list::{List, Task, TaskInput};
use base::error::{Error, InputPlace, Result, Setting};
use base::files::{self, Content, write_atomically};
use base::sha256::{Hash, hex, sha256_hex};
use posterior::monitor::{Monitor, THREADS_VARIABLE, refuse_if_stopped};
use record::Experiment;

/// Placeholder in a command for the directory into which the command must write its results.
pub const OUT: &str = "{out}";
/// File name of the table of all commands, in the folder of gathered results.
pub const TABLE: &str = "commands.csv";
/// Largest number of files in an input directory. A larger number suggests that a home directory was given by mistake.
const MOST_FILES: usize = 20_000;
/// Time between two checks whether a command has ended or the user has stopped the run.
const LOOK: Duration = Duration::from_millis(20);
/// File with a command's run times. It is not kept with the result, because it differs from run to run.
const TIMING: &str = "timing.json";
/// Number of last lines of a failed command's output that are shown.
const MOST_LINES: usize = 5;

/// Arguments of a task that runs a command, as the list of tasks stores them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct CommandTask {
    words: Vec<String>,
    /// SHA-256 of the content of each word that names a file or directory.
    inputs: BTreeMap<String, String>,
}

/// One command of a list, with its line number.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CommandLine {
    /// Line number, from 1.
    pub number: usize,
    /// Words of the command, without the program's name.
    pub words: Vec<String>,
}

/// Function that checks a line. It returns an error unless the line is a command of this program that a task may run.
pub type RefuseLine<'a> = &'a dyn Fn(&CommandLine) -> Result<()>;

/// Reads a list of commands: one per line, split into words as by a shell. Comments and empty lines are skipped.
///
/// # Errors
/// [`Error::File`] if the file is unreadable; [`Error::Input`] with the number of the line that is not a command.
pub fn read(path: &Path) -> Result<Vec<CommandLine>> {
    let bytes = files::read(path, Content::Document, "give a text file with one command per line")?;
    let refuse = |number: usize, found: &str, remedy: &str| {
        Err(Error::input(InputPlace::file(path).at_line(number), found.to_string(), remedy.to_string()))
    };
    let Ok(text) = String::from_utf8(bytes) else {
        return refuse(1, "this is not UTF-8 text", "give a text file with one command per line");
    };
    let mut lines = Vec::new();
    for (number, line) in text.lines().enumerate().map(|(place, line)| (place + 1, line)) {
        let Some(mut words) = shlex::split(line) else {
            return refuse(number, "a quotation mark is not closed", "close or remove the quotation mark");
        };
        if words.first().is_some_and(|word| word == "vitreo-uq") {
            words.remove(0);
        }
        if words.is_empty() {
            continue;
        }
        if !words.iter().any(|word| word.contains(OUT)) {
            let remedy = format!("write `{OUT}` as the place of its results, as in `diagnose eyes/a --out {OUT}`");
            return refuse(number, "this command writes no results to keep", &remedy);
        }
        lines.push(CommandLine { number, words });
    }
    Ok(lines)
}

/// Returns one task per command. Paths are relative to the current directory.
///
/// # Errors
/// [`Error::Input`] and [`Error::File`] if an input is unreadable.
pub fn work(lines: &[CommandLine]) -> Result<Vec<TaskInput>> {
    let mut known = BTreeMap::new();
    let one = |line: &CommandLine| {
        let arguments = CommandTask { words: line.words.clone(), inputs: inputs(&line.words, &mut known)? };
        Ok(TaskInput { arguments: json!(arguments), paths: Vec::new() })
    };
    lines.iter().map(one).collect()
}

/// Runs the command of a task. `refuse` checks the command first, because the list may come from another person.
///
/// # Errors
/// The errors of `refuse`; [`Error::Input`] if an input has changed or the command refuses its input; [`Error::Numerical`] with the command's output for
/// other failures.
pub fn run(task: &Task, refuse: RefuseLine<'_>, monitor: &dyn Monitor) -> Result<Vec<u8>> {
    let CommandTask { words, inputs: wanted } = task.arguments_as()?;
    refuse(&CommandLine { number: task.task + 1, words: words.clone() })?;
    let found = inputs(&words, &mut BTreeMap::new())?;
    if let Some(changed) = wanted.iter().chain(&found).find(|(word, _)| wanted.get(*word) != found.get(*word)) {
        return Err(Error::input(
            InputPlace::file(changed.0),
            "this input has changed since the list was made",
            format!(
                "make the list again with the same command and `{}`: results of unchanged inputs are reused",
                Setting::Force
            ),
        ));
    }
    let place = tempfile::Builder::new().prefix("vitreo-uq-task-").tempdir();
    let place = place.map_err(files::file_error("create a directory in", &std::env::temp_dir()))?;
    let (out, said) = (place.path().join("out"), place.path().join("said"));
    std::fs::create_dir(&out).map_err(files::file_error("create", &out))?;
    let program = std::env::current_exe().map_err(files::file_error("find", Path::new("the program itself")))?;
    let stderr = std::fs::File::create(&said).map_err(files::file_error("create", &said))?;
    let mut command = Command::new(program);
    command.args(words.iter().map(|word| word.replace(OUT, &out.display().to_string())));
    command.env(THREADS_VARIABLE, rayon::current_num_threads().to_string());
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(stderr);
    let mut child = command.spawn().map_err(files::file_error("start", Path::new("vitreo-uq")))?;
    let code = end_of(&mut child, monitor)?;
    if !matches!(code, Some(0 | 1)) {
        let text = std::fs::read_to_string(&said).unwrap_or_default();
        return Err(failure(&words, code, &text));
    }
    body(code.unwrap_or_default(), &out).and_then(|body| {
        let remedy = format!("direct the command's results to `{OUT}`");
        body.ok_or_else(|| Error::input(InputPlace::default(), format!("`{}` wrote nothing", as_line(&words)), remedy))
    })
}

/// Waits until the command ends, and kills the command if the run is stopped. Returns the exit code; `None` if a signal ended the command.
fn end_of(child: &mut Child, monitor: &dyn Monitor) -> Result<Option<i32>> {
    loop {
        match child.try_wait() {
            Ok(Some(status)) => return Ok(status.code()),
            Ok(None) => {}
            Err(source) => return Err(files::file_error("wait for", Path::new("a command"))(source)),
        }
        if let Err(stopped) = refuse_if_stopped(monitor, "written results are kept") {
            let _ = child.kill().and_then(|()| child.wait());
            return Err(stopped);
        }
        std::thread::sleep(LOOK);
    }
}

fn failure(words: &[String], code: Option<i32>, said: &str) -> Error {
    let lines: Vec<&str> = said.lines().filter(|line| !line.trim().is_empty()).collect();
    let last = lines[lines.len().saturating_sub(MOST_LINES)..].join("; ");
    let what = format!("`{}`: {}", as_line(words), last.strip_prefix("error: ").unwrap_or(&last));
    match code {
        Some(2) => Error::input(
            InputPlace::default(),
            what,
            format!("correct the command, and make the list again with `{}`", Setting::Force),
        ),
        Some(code) => Error::numerical(format!("{what} (exit code {code})"), "run the command by itself"),
        None => Error::numerical(format!("{what} (killed)"), "give the command more memory or time"),
    }
}

/// Computes content hashes of all words that name a file or directory, except the command's name. A value after `=` and each item of a comma-separated
/// list count as words. `known` caches earlier hashes.
fn inputs(words: &[String], known: &mut BTreeMap<PathBuf, String>) -> Result<BTreeMap<String, String>> {
    let mut found = BTreeMap::new();
    for word in words.iter().skip(1).filter(|word| !word.contains(OUT)) {
        let value = match word.split_once('=') {
            Some((option, value)) if option.starts_with('-') => value,
            _ => word.as_str(),
        };
        for part in std::iter::once(value).chain(value.split(',').filter(|part| *part != value)) {
            let path = Path::new(part);
            if part.is_empty() || !path.exists() {
                continue;
            }
            let hash = match known.get(path) {
                Some(hash) => hash.clone(),
                None => known.entry(path.to_path_buf()).or_insert(content_sha256(path)?).clone(),
            };
            found.insert(part.to_string(), hash);
        }
    }
    Ok(found)
}

/// SHA-256 of an input's content: of a file, of an experiment's TOML with its tables, or of all files of a directory with their names.
fn content_sha256(path: &Path) -> Result<String> {
    if path.is_file() {
        if let Ok((_, read)) = Experiment::read(path) {
            let log = read.log_file.map_or(Vec::new(), |(_, bytes)| bytes);
            return Ok(sha256_hex(&[read.toml_bytes, read.csv_bytes, log].concat()));
        }
        return Ok(sha256_hex(&input(path)?));
    }
    let mut all = Hash::new();
    for entry in files_below(path)? {
        let name = entry.strip_prefix(path).unwrap_or(&entry).to_string_lossy().into_owned();
        all.update(format!("{name}\n{}\n", sha256_hex(&input(&entry)?)));
    }
    Ok(hex(&all.finalize()))
}

fn input(path: &Path) -> Result<Vec<u8>> {
    files::read(path, Content::State, "name a readable input, or leave it out")
}

/// All files in a directory and its subdirectories, sorted. Links are skipped, because they may form a loop or lead to unintended files.
fn files_below(folder: &Path) -> Result<Vec<PathBuf>> {
    let (mut found, mut waiting) = (Vec::new(), vec![folder.to_path_buf()]);
    while let Some(folder) = waiting.pop() {
        for entry in std::fs::read_dir(&folder).map_err(files::file_error("read", &folder))? {
            let entry = entry.map_err(files::file_error("read", &folder))?;
            let kind = entry.file_type().map_err(files::file_error("read", &folder))?;
            if kind.is_dir() {
                waiting.push(entry.path());
            } else if kind.is_file() {
                found.push(entry.path());
            }
        }
        if found.len() > MOST_FILES {
            let what = format!("more than {MOST_FILES} files");
            return Err(Error::input(
                InputPlace::file(folder),
                what,
                "name the experiments of this directory one by one",
            ));
        }
    }
    found.sort();
    Ok(found)
}

/// Body of a command's result file: one line with the exit code, then a tar archive of the files that the command wrote into `out`. The archive contains
/// no times and no owners. `None` if the command wrote no file.
fn body(code: i32, out: &Path) -> Result<Option<Vec<u8>>> {
    let mut found = files_below(out)?;
    // Hidden files such as locks do not belong to the result.
    found.retain(|path| path.file_name().is_none_or(|name| name != TIMING && !name.to_string_lossy().starts_with('.')));
    if found.is_empty() {
        return Ok(None);
    }
    let mut archive = tar::Builder::new(format!("{code}\n").into_bytes());
    archive.mode(tar::HeaderMode::Deterministic);
    for path in found {
        let name = path.strip_prefix(out).unwrap_or(&path);
        archive.append_path_with_name(&path, name).map_err(files::file_error("keep", &path))?;
    }
    archive.into_inner().map(Some).map_err(files::file_error("keep", out))
}

/// Writes the files of a command's result into a folder. Returns the command's exit code, or `None` if `body` is not a result.
///
/// # Errors
/// [`Error::File`] if the file system refuses.
pub(super) fn keep(folder: &Path, body: &[u8]) -> Result<Option<i32>> {
    let Some(end) = body.iter().position(|byte| *byte == b'\n') else { return Ok(None) };
    let Some(code) = std::str::from_utf8(&body[..end]).ok().and_then(|text| text.parse().ok()) else { return Ok(None) };
    let Some(all) = entries(&body[end + 1..]) else { return Ok(None) };
    for (name, bytes) in all {
        let path = folder.join(name);
        if files::read_if_there(&path, Content::State).is_some_and(|there| there == bytes) {
            continue;
        }
        files::create_folders(files::folder_of(&path), "choose a writable directory")?;
        write_atomically(&path, &bytes)?;
    }
    Ok(Some(code))
}

/// Extracts names and contents of files from a tar archive. `None` if the archive is invalid, or if a name leads out of the target folder.
fn entries(archive: &[u8]) -> Option<Vec<(PathBuf, Vec<u8>)>> {
    let mut found = Vec::new();
    for entry in tar::Archive::new(archive).entries().ok()? {
        let mut entry = entry.ok()?;
        let name = entry.path().ok()?.into_owned();
        let is_plain = name.components().all(|part| matches!(part, Component::Normal(_)));
        let mut bytes = Vec::new();
        std::io::Read::read_to_end(&mut entry, &mut bytes).ok()?;
        if !is_plain || !entry.header().entry_type().is_file() {
            return None;
        }
        found.push((name, bytes));
    }
    Some(found)
}

/// Name of a task's folder within the gathered results.
pub(super) fn folder_name(task: &Task, n_tasks: usize) -> String {
    format!("{:0width$}", task.task, width = (n_tasks - 1).to_string().len())
}

/// Makes the CSV table of a list's commands, with the exit code of each available result.
///
/// # Errors
/// [`Error::Input`] if the list is damaged.
pub(super) fn table(list: &List, codes: &[Option<i32>]) -> Result<Vec<u8>> {
    let broken = || Error::numerical("the table of commands cannot be written", "report the command that was run");
    let mut table = csv::Writer::from_writer(Vec::new());
    table.write_record(["folder", "exit_code", "command"]).map_err(|_| broken())?;
    for (number, code) in codes.iter().enumerate() {
        let task = list.task(number)?;
        let CommandTask { words, .. } = task.arguments_as()?;
        let code = code.map_or(String::new(), |code| code.to_string());
        table.write_record([folder_name(&task, codes.len()), code, as_line(&words)]).map_err(|_| broken())?;
    }
    table.into_inner().map_err(|_| broken())
}

/// Joins words to a command line as a user would type it.
fn as_line(words: &[String]) -> String {
    shlex::try_join(words.iter().map(String::as_str)).unwrap_or_else(|_| words.join(" "))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(text: &str) -> Result<Vec<CommandLine>> {
        let folder = tempfile::tempdir().expect("a temporary directory");
        let path = folder.path().join("list.txt");
        std::fs::write(&path, text).expect("writable");
        read(&path)
    }

    #[test]
    fn a_list_is_read_as_a_shell_would() {
        let text =
            "# all eyes\n\nvitreo-uq diagnose 'eye 1' --out {out}/study\nfit eye-2 --json {out}/fit.json # second\n";
        let lines = line(text).expect("a list");
        assert_eq!(lines.iter().map(|line| line.number).collect::<Vec<_>>(), [3, 4]);
        assert_eq!(lines[0].words, ["diagnose", "eye 1", "--out", "{out}/study"]);
        assert_eq!(lines[1].words, ["fit", "eye-2", "--json", "{out}/fit.json"]);
        let refusal = line("fit a --out {out}\nfit 'b --out {out}").expect_err("open").to_string();
        assert!(refusal.contains("list.txt, line 2") && refusal.contains("quotation mark"), "{refusal}");
        let refusal = line("fit a --out b").expect_err("kept nowhere").to_string();
        assert!(refusal.contains("list.txt, line 1") && refusal.contains(OUT), "{refusal}");
    }

    /// Any changed content in a directory changes the input's hash. Equal content under equal names has an equal hash.
    #[test]
    fn inputs_are_known_by_their_content() {
        let folder = tempfile::tempdir().expect("a temporary directory");
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir_all(at("eye/raw")).expect("writable");
        std::fs::write(at("eye/raw/a.csv"), "1").expect("writable");
        std::fs::write(at("law.toml"), "2").expect("writable");
        let eye = at("eye").display().to_string();
        let both = format!("--with={},softening", at("law.toml").display());
        let words = ["diagnose", &eye, &both, "--out", "{out}"].map(String::from);
        let hashes = || inputs(&words, &mut BTreeMap::new()).expect("readable");
        let before = hashes();
        assert_eq!(before.keys().collect::<Vec<_>>(), [&eye, &at("law.toml").display().to_string()]);
        assert_eq!(before, hashes());
        std::fs::write(at("law.toml"), "3").expect("writable");
        let after = hashes();
        assert!(after[&eye] == before[&eye] && after != before);
        std::fs::write(at("eye/raw/a.csv"), "4").expect("writable");
        assert_ne!(hashes()[&eye], after[&eye]);
    }

    #[test]
    fn files_come_back_and_none_goes_astray() {
        let (out, back) = (tempfile::tempdir().expect("one"), tempfile::tempdir().expect("two"));
        assert_eq!(body(0, out.path()).expect("readable"), None);
        std::fs::create_dir_all(out.path().join("study/r0")).expect("writable");
        std::fs::write(out.path().join("study/r0/a.png"), [0, 255, 10]).expect("writable");
        std::fs::write(out.path().join("b.json"), "{}").expect("writable");
        let kept = body(1, out.path()).expect("readable").expect("files");
        assert_eq!(body(1, out.path()).expect("readable").as_ref(), Some(&kept));
        assert_eq!(keep(back.path(), &kept).expect("writable"), Some(1));
        assert_eq!(std::fs::read(back.path().join("study/r0/a.png")).expect("there"), [0, 255, 10]);
        let mut archive = tar::Builder::new(b"0\n".to_vec());
        let mut header = tar::Header::new_gnu();
        header.as_old_mut().name[..9].copy_from_slice(b"../astray");
        header.set_size(1);
        header.set_cksum();
        archive.append(&header, &b"x"[..]).expect("an archive");
        assert_eq!(keep(&back.path().join("in"), &archive.into_inner().expect("bytes")).expect("readable"), None);
        assert!(!back.path().join("astray").exists());
        for damaged in [&b""[..], b"0", b"zero\n", b"0\nno archive, but as long as a block of one would be"] {
            assert_eq!(keep(back.path(), damaged).expect("readable"), None);
        }
    }
}
