//! A program killed while it writes a study leaves only complete revisions, and the next one can continue.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use vitreo_uq::base::files::write_atomically;
use vitreo_uq::posterior::study::Study;
use vitreo_uq::record::ExperimentFiles;

/// Environment variable of the process that is to be killed; it names the study.
const VICTIM_DIR: &str = "VITREO_UQ_TEST_VICTIM_DIR";
const FILES: [&str; 3] = ["model.toml", "posterior.json", "comparison.json"];

fn content(number: usize) -> String {
    format!("{number:08}").repeat(5_000)
}

fn write_revisions_for_ever(dir: &Path) -> ! {
    let study = Study::open(dir).unwrap();
    for number in 1_usize.. {
        let writer = study.begin_revision("m0").unwrap();
        for file in FILES {
            std::fs::write(writer.path().join(file), content(number)).unwrap();
        }
        writer.commit().unwrap();
        write_atomically(&study.checkpoint_dir("m0").unwrap().join("state"), content(number).as_bytes()).unwrap();
        std::fs::write(dir.with_file_name("at-work"), "").unwrap();
    }
    unreachable!("the loop has no end")
}

fn number_in(path: &Path) -> usize {
    let text = std::fs::read_to_string(path).unwrap();
    let number = text[..8].parse().unwrap();
    assert_eq!(text, content(number), "{} is half written", path.display());
    number
}

#[test]
fn killed_writers_leave_whole_revisions_and_a_usable_study() {
    if let Some(dir) = std::env::var_os(VICTIM_DIR) {
        write_revisions_for_ever(Path::new(&dir));
    }
    let place = tempfile::tempdir().unwrap();
    let dir = place.path().join("study");
    let files = ExperimentFiles {
        toml_name: "experiment.toml".into(),
        toml_bytes: b"[specimen]\n".to_vec(),
        csv_name: "trajectory.csv".into(),
        csv_bytes: b"time_s\n".to_vec(),
        log_file: None,
        notes: vec![],
        interpretation: vitreo_uq::record::Interpretation::default(),
    };
    let study = Study::open_or_create(&dir, &files, false).unwrap();
    let mut n_killed_at_work = 0;
    for round in 0..25_u64 {
        let mut victim = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "study_survives_kill::killed_writers_leave_whole_revisions_and_a_usable_study"])
            .env(VICTIM_DIR, &dir)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        // Waits for the first revision, and then for a moment that differs between rounds.
        let at_work = dir.with_file_name("at-work");
        while !at_work.exists() {
            assert_eq!(victim.try_wait().unwrap(), None, "the victim must not end by itself");
            std::thread::sleep(Duration::from_millis(1));
        }
        std::thread::sleep(Duration::from_millis((round * 37) % 41));
        assert_eq!(victim.try_wait().unwrap(), None, "the victim must still be writing when it is killed");
        victim.kill().unwrap();
        victim.wait().unwrap();
        std::fs::remove_file(&at_work).unwrap();
        let hidden = std::fs::read_dir(&dir).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
        n_killed_at_work += usize::from(hidden.into_iter().any(|name| name.starts_with(".m0.partial-")));

        // Opening and writing again works: the lock of the dead program is gone and its leftovers are removed.
        let study_again = Study::open_or_create(&dir, &files, false).unwrap();
        drop(study_again.begin_revision("m1").unwrap());
        let names = std::fs::read_dir(&dir).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
        assert!(names.into_iter().all(|name| !name.contains(".partial-")));
        assert_eq!(study.revisions().unwrap(), ["m0"]);
        let numbers = FILES.map(|file| number_in(&study.revision_dir("m0").unwrap().join(file)));
        assert!(numbers.iter().all(|number| *number == numbers[0]), "files of different runs: {numbers:?}");
        assert!(numbers[0] >= 1);
        number_in(&study.checkpoint_dir("m0").unwrap().join("state"));
    }
    assert!(n_killed_at_work > 0, "no kill came while a revision was being written");
}
