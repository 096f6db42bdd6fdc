use std::process::{Command, Stdio};
use std::time::Duration;

use super::*;

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// A process that has ended: its number is free, unless another took it within a moment.
fn dead_process() -> u32 {
    let mut child = Command::new("true").stdin(Stdio::null()).spawn().unwrap();
    child.wait().unwrap();
    child.id()
}

#[cfg(any(target_os = "linux", target_vendor = "apple"))]
#[test]
fn leftovers_of_dead_processes_go_and_those_of_living_ones_stay() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: String| folder.path().join(name);
    let mut alive = Command::new("sleep").arg("60").stdin(Stdio::null()).spawn().unwrap();
    let (dead, own) = (dead_process(), std::process::id());
    std::fs::write(at(format!(".partial-{dead}-abc")), "x").unwrap();
    std::fs::create_dir_all(at(format!(".m0.partial-{dead}-abc/figures"))).unwrap();
    let stay =
        [format!(".partial-{}-abc", alive.id()), format!(".partial-{own}-abc"), ".partial-abc".into(), "m0".into()];
    stay.iter().for_each(|name| std::fs::write(at(name.clone()), "x").unwrap());
    // A process of another machine, whose number means nothing here, holds the lock.
    let elsewhere = at(format!(".partial-{dead}-def"));
    let held = File::create(&elsewhere).unwrap();
    held.try_lock().unwrap();
    write_atomically(&at("new".into()), b"x").unwrap();
    let mut expected = stay.to_vec();
    expected.extend(["new".to_string(), elsewhere.file_name().unwrap().to_string_lossy().into_owned()]);
    expected.sort();
    assert_eq!(names(folder.path()), expected);
    alive.kill().unwrap();
    alive.wait().unwrap();
}

#[test]
fn files_that_belong_together_are_all_replaced_or_none() {
    let folder = tempfile::tempdir().unwrap();
    let (first, second) = (folder.path().join("a"), folder.path().join("b"));
    write_together(&[(&first, b"1"), (&second, b"2")]).unwrap();
    let nowhere = folder.path().join("missing").join("c");
    let error = write_together(&[(&first, b"3"), (&nowhere, b"4")]).unwrap_err();
    assert!(matches!(&error, Error::File { source, .. } if source.kind() == std::io::ErrorKind::NotFound), "{error}");
    assert_eq!(std::fs::read(&first).unwrap(), b"1");
    assert_eq!(names(folder.path()), ["a", "b"]);
}

#[cfg(unix)]
#[test]
fn pipes_and_devices_and_directories_are_refused_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("pipe");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    for (path, word) in [(pipe.as_path(), "a pipe"), (Path::new("/dev/zero"), "a device"), (folder.path(), "directory")]
    {
        let error = read(path, Content::Table, "give a file").unwrap_err();
        assert_eq!(error.exit_code(), 2);
        assert!(error.to_string().contains(word) && error.to_string().contains("what to do: "), "{error}");
    }
}

#[test]
fn what_is_too_large_is_refused_without_being_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("huge");
    for content in [Content::Settings, Content::Document, Content::Table, Content::Mesh, Content::State] {
        // A hole takes no room on the disk.
        File::create(&path).unwrap().set_len(content.most_bytes() + 1).unwrap();
        let began = std::time::Instant::now();
        let error = read(&path, content, "").unwrap_err().to_string();
        assert!(error.contains("MiB"), "{error}");
        assert!(began.elapsed() < Duration::from_secs(5));
    }
    File::create(&path).unwrap().set_len(Content::Settings.most_bytes()).unwrap();
    assert_eq!(read(&path, Content::Settings, "").unwrap().len() as u64, Content::Settings.most_bytes());
}
