use std::process::{Command, Stdio};
use std::time::Duration;

use super::*;

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// Process number of a process that has ended. Another process could take this number during the test, but this is very unlikely.
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
    let (dead, index) = (dead_process(), std::process::id());
    std::fs::write(at(format!(".partial-{dead}-abc")), "x").unwrap();
    std::fs::create_dir_all(at(format!(".m0.partial-{dead}-abc/figures"))).unwrap();
    let stay =
        [format!(".partial-{}-abc", alive.id()), format!(".partial-{index}-abc"), ".partial-abc".into(), "m0".into()];
    stay.iter().for_each(|name| std::fs::write(at(name.clone()), "x").unwrap());
    // A process on another machine holds the lock. Its process number has no meaning on this machine.
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
        // A sparse file occupies no space on the disk.
        File::create(&path).unwrap().set_len(content.max_bytes() + 1).unwrap();
        let began = std::time::Instant::now();
        let error = read(&path, content, "").unwrap_err().to_string();
        assert!(error.contains("MiB"), "{error}");
        assert!(began.elapsed() < Duration::from_secs(5));
    }
    File::create(&path).unwrap().set_len(Content::Settings.max_bytes()).unwrap();
    assert_eq!(read(&path, Content::Settings, "").unwrap().len() as u64, Content::Settings.max_bytes());
}

/// Makes a directory `in/` in which links are forbidden, and a secret file outside it. Returns the parent directory and a link to `in/`.
#[cfg(any(target_os = "linux", target_vendor = "apple"))]
fn enclosed_place() -> (tempfile::TempDir, std::path::PathBuf) {
    let place = tempfile::tempdir().unwrap();
    std::fs::create_dir_all(place.path().join("in/m0")).unwrap();
    std::fs::create_dir(place.path().join("out")).unwrap();
    std::fs::write(place.path().join("out/secret"), "secret").unwrap();
    let named = place.path().join("named");
    std::os::unix::fs::symlink("in", &named).unwrap();
    forbid_links(&named, "a study");
    (place, named)
}

#[cfg(any(target_os = "linux", target_vendor = "apple"))]
#[test]
fn no_link_beneath_an_enclosed_directory_is_followed() {
    use std::os::unix::fs::symlink;
    let (place, named) = enclosed_place();
    let outside = place.path().join("out");
    symlink(outside.join("secret"), named.join("m0/file")).unwrap();
    symlink(&outside, named.join("folder")).unwrap();
    symlink("..", named.join("m0/up")).unwrap();
    symlink("loop", named.join("loop")).unwrap();
    symlink(outside.join("new"), named.join("dangling")).unwrap();
    let is_refused = |found: Error, path: &Path, link: &str| {
        let (text, place) = (found.to_string(), named.join(link).display().to_string());
        let words = "this is a symbolic link; links inside a study are not followed";
        assert!(text.starts_with(&place) && text.contains(words) && text.contains("what to do: put a copy"), "{text}");
        assert_eq!(found.exit_code(), 2, "{}", path.display());
    };
    for (path, link) in [
        ("m0/file", "m0/file"),
        ("folder/secret", "folder"),
        ("m0/up/m0/file", "m0/up"),
        ("loop", "loop"),
        ("dangling", "dangling"),
        ("folder", "folder"),
    ] {
        // Both the path through the link that the user gives and the path without links are tested.
        for root in [named.clone(), place.path().canonicalize().unwrap().join("in")] {
            let path = root.join(path);
            let error = read(&path, Content::Table, "").unwrap_err();
            assert!(error.to_string().contains("links inside a study are not followed"), "{error}");
            assert!(read_if_there(&path, Content::Table).is_none() && !is_file(&path) && !is_folder(&path));
            assert!(refuse_link(&path).is_err());
        }
        is_refused(read(&named.join(path), Content::Table, "").unwrap_err(), Path::new(path), link);
    }
    for path in ["folder/new", "m0/up/new", "loop/new", "dangling/new"] {
        let path = named.join(path);
        assert!(write_atomically(&path, b"x").is_err(), "{}", path.display());
        assert!(
            create_folders(&path, "").is_err() && create_or_replace(&path, "").is_err() && open_lock(&path).is_err()
        );
        assert!(entries(folder_of(&path), "").is_err());
        assert!(remove_all(&path).is_err() && rename(&named.join("m0"), &path).is_err());
    }
    assert!(open_lock(&named.join("m0/file")).is_err() && open_lock(&named.join("dangling")).is_err());
    let listed = entries(&named, "").unwrap();
    let kind = |name: &str| listed.iter().find(|pair| pair.0 == name).unwrap().1;
    assert_eq!([kind("folder"), kind("loop"), kind("m0")], [FileKind::Link, FileKind::Link, FileKind::Folder]);
    assert!(
        read(&named.join("m0/../../out/secret"), Content::Table, "")
            .is_err_and(|error| error.to_string().contains("leads out of a study"))
    );
    // Writing replaces a link by a file, and removing removes the link but not its target.
    write_atomically(&named.join("m0/file"), b"own").unwrap();
    assert_eq!(read(&named.join("m0/file"), Content::Table, "").unwrap(), b"own");
    create_or_replace(&named.join("dangling"), "").unwrap();
    std::fs::remove_file(named.join("m0/file")).unwrap();
    symlink(&outside, named.join("m0/deep")).unwrap();
    remove_all(&named.join("m0")).unwrap();
    remove_all(&named.join("folder")).unwrap();
    assert_eq!(names(&outside), ["secret"]);
    assert_eq!(std::fs::read(outside.join("secret")).unwrap(), b"secret");
}

/// While files are read and written, another thread repeatedly exchanges a link with a directory or a file. The link is never followed.
#[cfg(any(target_os = "linux", target_vendor = "apple"))]
#[test]
fn a_link_that_comes_in_the_meantime_is_not_followed() {
    use std::sync::atomic::{AtomicBool, Ordering};
    // The flag is set even if the test fails; otherwise the other thread would run forever.
    struct Over<'a>(&'a AtomicBool);
    impl Drop for Over<'_> {
        fn drop(&mut self) {
            self.0.store(true, Ordering::Relaxed);
        }
    }
    for (target, changed) in [("out", "in/m0"), ("out/secret", "in/m0/secret")] {
        let (place, named) = enclosed_place();
        let (outside, m0) = (place.path().join("out"), named.join("m0"));
        std::fs::write(m0.join("secret"), "harmless").unwrap();
        let link = place.path().join("link");
        std::os::unix::fs::symlink(place.path().join(target), &link).unwrap();
        let is_over = AtomicBool::new(false);
        let mut n_read = [0, 0];
        std::thread::scope(|scope| {
            let _over = Over(&is_over);
            scope.spawn(|| {
                while !is_over.load(Ordering::Relaxed) {
                    let _ = exchange(&link, &place.path().join(changed));
                }
            });
            // On a busy processor the loop continues until both outcomes have occurred.
            for round in 0..300_000 {
                if round > 3000 && !n_read.contains(&0) {
                    break;
                }
                match read(&m0.join("secret"), Content::Table, "") {
                    Ok(bytes) => {
                        assert_eq!(bytes, b"harmless");
                        n_read[0] += 1;
                    }
                    Err(_) => n_read[1] += 1,
                }
                if round % 30 == 0 {
                    let _ = write_atomically(&m0.join("written"), b"x");
                    let _ = create_folders(&m0.join("made"), "");
                    let _ = remove_all(&m0.join("secret-of-nobody"));
                    let _ = open_lock(&m0.join("secret"));
                }
            }
        });
        assert_eq!(names(&outside), ["secret"], "something was written outside");
        assert_eq!(std::fs::read(outside.join("secret")).unwrap(), b"secret");
        assert!(n_read.iter().all(|n| *n > 0), "the race was not run: {n_read:?}");
    }
}
