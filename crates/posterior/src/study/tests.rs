use super::*;
use base::files::{write_atomically, write_json_atomically};
use std::sync::atomic::{AtomicBool, Ordering};

fn files(id: &str) -> ExperimentFiles {
    ExperimentFiles {
        toml_name: "anything.toml".into(),
        toml_bytes: format!("[specimen]\nid = \"{id}\"\n").into_bytes(),
        csv_name: "data/trajectory.csv".into(),
        csv_bytes: b"time_s,force_N,position_m\r\n".to_vec(),
        log_file: None,
        notes: vec![],
        interpretation: record::Interpretation::default(),
    }
}

fn visible_names(dir: &Path) -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(dir)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| !name.starts_with('.'))
        .collect();
    names.sort();
    names
}

fn write_revision(study: &Study, name: &str, content: &str) {
    let writer = study.begin_revision(name).unwrap();
    for file in ["model.toml", "posterior.json"] {
        std::fs::write(writer.path().join(file), content).unwrap();
    }
    writer.commit().unwrap();
}

fn found_in(error: Error) -> (String, u8) {
    let code = error.exit_code();
    match error {
        Error::Input { found, remedy, .. } => {
            assert!(!remedy.is_empty());
            (found, code)
        }
        other => panic!("{other}"),
    }
}

#[test]
fn a_study_copies_its_input_byte_for_byte_and_records_the_hashes() {
    let place = tempfile::tempdir().unwrap();
    let dir = place.path().join("a/b");
    let study = Study::open_or_create(&dir, &files("x"), false).unwrap();
    assert_eq!(std::fs::read(dir.join("experiment.toml")).unwrap(), files("x").toml_bytes);
    assert_eq!(std::fs::read(dir.join("data/trajectory.csv")).unwrap(), files("x").csv_bytes);
    let record = std::fs::read_to_string(dir.join("inputs.sha256")).unwrap();
    assert!(record.contains(&format!("{}  data/trajectory.csv\n", sha256_hex(&files("x").csv_bytes))));
    assert_eq!(study.provenance("posterior", 1, 7).inputs_sha256, *study.inputs_sha256());
    assert_eq!(visible_names(&place.path().join("a")), ["b"]);
    assert_eq!(std::fs::read_dir(place.path().join("a")).unwrap().count(), 1, "nothing hidden is left");
}

#[test]
fn the_same_input_is_continued_with_its_revisions_even_under_force() {
    let place = tempfile::tempdir().unwrap();
    let study = Study::open_or_create(place.path(), &files("x"), false).unwrap();
    write_revision(&study, "m0", "first");
    for force in [false, true] {
        let again = Study::open_or_create(place.path(), &files("x"), force).unwrap();
        assert_eq!(again.revisions().unwrap(), ["m0"]);
    }
    assert_eq!(Study::open(place.path()).unwrap().inputs_sha256(), study.inputs_sha256());
}

#[test]
fn a_different_input_is_refused_and_force_replaces_it() {
    let place = tempfile::tempdir().unwrap();
    let dir = place.path().join("study");
    let study = Study::open_or_create(&dir, &files("x"), false).unwrap();
    write_revision(&study, "m0", "first");
    let before = visible_names(&dir);
    let (found, code) = found_in(Study::open_or_create(&dir, &files("y"), false).unwrap_err());
    assert!(found.contains("another input") && code == 2, "{found}");
    assert_eq!(visible_names(&dir), before);
    let replaced = Study::open_or_create(&dir, &files("y"), true).unwrap();
    assert!(replaced.revisions().unwrap().is_empty());
    assert_eq!(std::fs::read(dir.join("experiment.toml")).unwrap(), files("y").toml_bytes);
    assert_eq!(std::fs::read_dir(place.path()).unwrap().count(), 1, "the old study is gone");
}

#[cfg(unix)]
#[test]
fn an_empty_directory_is_filled_in_place() {
    use std::os::unix::fs::MetadataExt;
    let place = tempfile::tempdir().unwrap();
    let inode = std::fs::metadata(place.path()).unwrap().ino();
    let link = place.path().with_extension("link");
    std::os::unix::fs::symlink(place.path(), &link).unwrap();
    let study = Study::open_or_create(&link, &files("x"), false);
    std::fs::remove_file(&link).unwrap();
    study.unwrap();
    assert_eq!(std::fs::metadata(place.path()).unwrap().ino(), inode);
    assert_eq!(std::fs::read_dir(place.path()).unwrap().count(), 3);
    Study::open(place.path()).unwrap();
}

#[test]
fn a_directory_with_other_files_is_never_replaced() {
    let place = tempfile::tempdir().unwrap();
    std::fs::write(place.path().join("thesis.tex"), "x").unwrap();
    for force in [false, true] {
        let (found, code) = found_in(Study::open_or_create(place.path(), &files("x"), force).unwrap_err());
        assert!(found.contains("not a study") && code == 2);
    }
    assert_eq!(visible_names(place.path()), ["thesis.tex"]);
    assert!(found_in(Study::open(place.path()).unwrap_err()).0.contains("not a study"));
}

#[test]
fn a_changed_copy_is_noticed() {
    let place = tempfile::tempdir().unwrap();
    Study::open_or_create(place.path(), &files("x"), false).unwrap();
    std::fs::write(place.path().join("data/trajectory.csv"), "time_s\n").unwrap();
    assert!(found_in(Study::open(place.path()).unwrap_err()).0.contains("changed"));
    assert!(found_in(Study::open_or_create(place.path(), &files("x"), false).unwrap_err()).0.contains("changed"));
}

#[test]
fn names_that_a_study_needs_itself_are_refused() {
    let place = tempfile::tempdir().unwrap();
    for name in ["experiment.toml", "m0/data.csv", ".lock", "inputs.sha256"] {
        let files = ExperimentFiles { csv_name: name.into(), ..files("x") };
        let (found, _) = found_in(Study::open_or_create(place.path(), &files, false).unwrap_err());
        assert!(found.contains(name));
    }
    assert_eq!(std::fs::read_dir(place.path()).unwrap().count(), 0);
}

#[test]
fn a_revision_is_invisible_until_committed_and_gone_when_dropped() {
    let place = tempfile::tempdir().unwrap();
    let study = Study::open_or_create(place.path(), &files("x"), false).unwrap();
    let before = visible_names(place.path());
    let writer = study.begin_revision("m0").unwrap();
    std::fs::write(writer.path().join("posterior.json"), "half").unwrap();
    assert_eq!(visible_names(place.path()), before);
    assert!(study.revisions().unwrap().is_empty());
    assert!(study.revision_dir("m0").is_err_and(|error| error.to_string().contains("this study has no such revision")));
    let hidden = writer.path().to_path_buf();
    drop(writer);
    assert!(!hidden.exists() && visible_names(place.path()) == before);
    write_revision(&study, "m10", "x");
    write_revision(&study, "m2", "x");
    assert_eq!(study.revisions().unwrap(), ["m2", "m10"]);
    assert!(study.revision_dir("m2").unwrap().join("model.toml").is_file());
    for name in ["m", "m01", "../m1", "m-1", "x"] {
        for error in [study.begin_revision(name).err(), study.checkpoint_dir(name).err()] {
            let error = error.expect(name).to_string();
            assert!(error.contains("this is not the name of a revision"), "{error}");
        }
    }
}

/// A killed program runs no destructor. The test therefore forgets the writer and releases its lock, as the operating system does.
#[test]
fn a_kill_half_way_leaves_the_old_revision_the_checkpoint_and_nothing_else_visible() {
    let place = tempfile::tempdir().unwrap();
    let study = Study::open_or_create(place.path(), &files("x"), false).unwrap();
    write_revision(&study, "m0", "old");
    let before = visible_names(place.path());
    let checkpoint = study.checkpoint_dir("m0").unwrap();
    write_atomically(&checkpoint.join("walkers.bin"), b"state").unwrap();
    // These are leftovers of killed programs. One program was killed between the two renamings of a directory replacement.
    let left = place.path().join(".m0.partial-dead");
    std::fs::create_dir(&left).unwrap();
    std::fs::write(left.join("posterior.json"), "ha").unwrap();
    std::fs::rename(place.path().join("m0"), place.path().join(".m0.replaced")).unwrap();
    let writer = Study::open(place.path()).unwrap().begin_revision("m0").unwrap();
    assert!(!left.exists());
    assert_eq!(visible_names(place.path()), before);
    assert_eq!(std::fs::read_to_string(place.path().join("m0/model.toml")).unwrap(), "old");
    assert_eq!(std::fs::read(study.checkpoint_dir("m0").unwrap().join("walkers.bin")).unwrap(), b"state");
    drop(writer);
    study.discard_checkpoint("m0").unwrap();
    study.discard_checkpoint("m0").unwrap();
    assert!(!checkpoint.exists());
}

#[test]
fn one_writer_at_a_time() {
    let place = tempfile::tempdir().unwrap();
    let study = Study::open_or_create(place.path(), &files("x"), false).unwrap();
    let writer = study.begin_revision("m0").unwrap();
    assert!(found_in(study.begin_revision("m1").unwrap_err()).0.contains("another program"));
    assert!(
        found_in(Study::open_or_create(place.path(), &files("y"), true).unwrap_err()).0.contains("another program")
    );
    drop(writer);
    study.begin_revision("m1").unwrap();
}

#[test]
fn readers_see_a_whole_revision_whenever_they_look() {
    let place = tempfile::tempdir().unwrap();
    let study = Study::open_or_create(place.path(), &files("x"), false).unwrap();
    let content = |number: u32| format!("{number:05}").repeat(20_000);
    write_revision(&study, "m0", &content(0));
    let summary = place.path().join("ladder.json");
    write_atomically(&summary, content(0).as_bytes()).unwrap();
    let done = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let readers: Vec<_> = (0..2)
            .map(|_| {
                scope.spawn(|| {
                    let mut n_looks = 0;
                    while !done.load(Ordering::Relaxed) {
                        let path = if n_looks % 2 == 0 { &summary } else { &place.path().join("m0/posterior.json") };
                        let text = std::fs::read_to_string(path).unwrap();
                        assert_eq!(text.len(), 100_000);
                        assert!(text.as_bytes().chunks(5).all(|chunk| chunk == &text.as_bytes()[..5]));
                        n_looks += 1;
                    }
                    n_looks
                })
            })
            .collect();
        for number in 1..60 {
            write_revision(&study, "m0", &content(number));
            write_atomically(&summary, content(number).as_bytes()).unwrap();
        }
        done.store(true, Ordering::Relaxed);
        assert!(readers.into_iter().map(|reader| reader.join().unwrap()).sum::<u32>() > 20);
    });
    assert_eq!(std::fs::read_to_string(place.path().join("m0/model.toml")).unwrap(), content(59));
}

#[test]
fn replacing_a_file_fails_without_harm_where_the_place_is_missing() {
    let place = tempfile::tempdir().unwrap();
    let error = write_atomically(&place.path().join("absent/file.json"), b"x").unwrap_err();
    assert!(matches!(error, Error::File { .. }));
    let path = place.path().join("value.json");
    write_json_atomically(&path, &vec![1, 2]).unwrap();
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "[\n  1,\n  2\n]\n");
    assert_eq!(std::fs::read_dir(place.path()).unwrap().count(), 1);
}

#[test]
fn specimen_ids_become_safe_directories() {
    let name = |id: &str| Study::default_dir(id).file_name().unwrap().to_str().unwrap().to_string();
    assert_eq!(name("porcine-01"), "porcine-01");
    assert_eq!(name("../../etc/pass wd"), "etc-pass-wd");
    assert_eq!(name("..."), "specimen");
    assert_eq!(name("Glaskörper 7"), "Glaskörper-7");
    assert!(Study::default_dir("a").starts_with("vitreo-uq-out"));
    assert_eq!(name(&"x".repeat(500)).len(), 80);
}
