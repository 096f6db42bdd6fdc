//! Folder that a workbench shows: its experiments and studies, and the files that the page may read.

use std::ffi::OsString;
use std::path::{Component, Path, PathBuf};

use serde::Serialize;
use vitreo_uq::base::error::{Error, InputPlace, Result};
use vitreo_uq::base::files::{self, Content, FileKind};
use vitreo_uq::posterior::study::Study;

/// Environment variable of the commands that a workbench starts. It contains the workbench's folder. The commands also treat the files in this folder as
/// untrusted data.
pub const FOLDER_VARIABLE: &str = "VITREO_UQ_WORKBENCH";
/// Name of the folder for the workbench's private files: uploads, and the record of its job.
const PRIVATE_FOLDER: &str = ".vitreo-uq-workbench";
/// Default directory of results of `groups`.
pub const GROUPS: &str = "vitreo-uq-out/groups";
/// Name of the file that describes an experiment.
pub const DESCRIPTION: &str = "experiment.toml";
/// Default folder of studies.
const STUDIES: &str = "vitreo-uq-out";
/// Extensions of the files in a study that the page may show or offer for download.
const SHOWN: [&str; 8] = ["svg", "png", "pdf", "html", "csv", "json", "toml", "nc"];
/// Maximum number of entries of a folder that are read.
const MOST_ENTRIES: usize = 5000;

/// Folder with the experiments and studies that a workbench shows.
#[derive(Debug, Clone)]
pub struct WorkbenchFolder {
    dir: PathBuf,
}

/// Item that the page lists: an experiment, a study, an experiment with its study, or results of `groups` or `shapes`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Item {
    /// Path within the workbench's folder. It is also the item's name.
    pub name: String,
    /// Folder of the experiment, relative to the workbench's folder; `None` without an experiment.
    pub experiment: Option<PathBuf>,
    /// Folder of the study, relative to the workbench's folder. It need not exist yet.
    pub study: PathBuf,
    /// Names of the finished revisions in the study.
    pub revisions: Vec<String>,
    /// Names of the figures in results of `groups` or `shapes`; empty for a study.
    pub figures: Vec<String>,
}

impl WorkbenchFolder {
    /// Finds the workbench's folder for a path that the user gives, and the name of the item if the path is that of an item.
    pub fn of(target: &Path) -> Result<(Self, Option<String>)> {
        let whole = std::fs::canonicalize(target).map_err(|error| {
            Error::at_path("open", target, error, "give an experiment, a study, or a folder of them")
        })?;
        let whole = match whole.file_name() {
            Some(name) if name == DESCRIPTION => whole.parent().map_or(whole.clone(), Path::to_path_buf),
            _ => whole,
        };
        if !whole.is_dir() {
            return Err(Error::input(
                InputPlace::file(target),
                "this is not a folder",
                "give an experiment, a study, or a folder of them; drop tables on the page",
            ));
        }
        if !(Study::is_study(&whole) || whole.join(DESCRIPTION).is_file()) {
            return Ok((Self::in_folder(whole), None));
        }
        let parent = whole.parent().unwrap_or(&whole);
        let dir = match parent.file_name() {
            Some(name) if name == STUDIES => parent.parent().unwrap_or(parent),
            _ => parent,
        };
        let home = Self::in_folder(dir.to_path_buf());
        let inside = whole.strip_prefix(dir).unwrap_or(&whole).to_path_buf();
        let of = |item: &Item| item.experiment.as_ref() == Some(&inside) || item.study == inside;
        let name = home.items().into_iter().find(of).map(|item| item.name);
        Ok((home, name))
    }

    /// Creates the workbench folder `dir`. Its files are treated as untrusted, because they may come from other people.
    fn in_folder(dir: PathBuf) -> Self {
        files::forbid_links_in_user_folder(&dir, "a workbench's folder");
        Self { dir }
    }

    /// Absolute path of the workbench's folder.
    pub fn dir(&self) -> &Path {
        &self.dir
    }

    /// Path of the folder for the workbench's private files.
    pub fn own(&self) -> PathBuf {
        self.dir.join(PRIVATE_FOLDER)
    }

    /// All items: experiments with their studies, then studies without an experiment.
    pub fn items(&self) -> Vec<Item> {
        let mut items = Vec::new();
        for name in folders(&self.dir) {
            let inside = PathBuf::from(&name);
            if Study::is_study(&self.dir.join(&inside)) {
                items.push(self.item(name, None, inside));
            } else if files::is_file(&self.dir.join(&inside).join(DESCRIPTION)) {
                let id = of_specimen(&self.dir.join(&inside), "id").unwrap_or_else(|| name.clone());
                items.push(self.item(name, Some(inside), Study::default_dir(&id)));
            }
        }
        let within = |folder: &'static str| {
            folders(&self.dir.join(folder)).into_iter().map(move |name| Path::new(folder).join(name))
        };
        for inside in within(STUDIES).chain(within(GROUPS)).collect::<Vec<PathBuf>>() {
            let whole = self.dir.join(&inside);
            let is_known = items.iter().any(|item| item.study == inside);
            let is_sheet = ["groups.json", "shapes.json"].iter().any(|document| files::is_file(&whole.join(document)));
            if !is_known && (is_sheet || Study::is_study(&whole)) {
                let mut item = self.item(inside.display().to_string(), None, inside);
                if is_sheet {
                    item.figures = drawings(&whole);
                }
                items.push(item);
            }
        }
        items
    }

    /// Item for a new sample record.
    pub fn example(&self) -> Item {
        let name = self.new_experiment("sample-record");
        Item { experiment: Some(name.clone().into()), ..self.item(name.clone(), None, name.into()) }
    }

    /// Item for the comparison of groups that these keys define.
    pub fn groups(&self, keys: &[String]) -> Item {
        let study = Path::new(GROUPS).join(keys.join("-"));
        Item { name: study.display().to_string(), experiment: None, study, revisions: Vec::new(), figures: Vec::new() }
    }

    /// Values of these keys of an item's specimen; `None` if they are not given.
    pub fn specimen_keys<const N: usize>(&self, item: &Item, keys: [&str; N]) -> [Option<String>; N] {
        let dir = self.dir.join(item.experiment.as_ref().unwrap_or(&item.study));
        keys.map(|key| of_specimen(&dir, key))
    }

    /// Whether another item has the same study: experiments of one specimen, or the folder of all results of `groups`.
    pub fn shares_study(&self, item: &Item) -> bool {
        share_study(&self.items(), item)
    }

    /// Whether a new experiment may have this name.
    pub fn is_free(&self, name: &str) -> bool {
        let is_there = |inside: &Path| files::kind(&self.dir.join(inside)).is_some();
        name != STUDIES && !is_there(Path::new(name)) && !is_there(&Study::default_dir(name))
    }

    /// Folders of the experiments whose descriptions give all of these keys of the specimen.
    pub fn experiments_with_keys(&self, keys: &[String]) -> Vec<PathBuf> {
        let has_all = |inside: &PathBuf| keys.iter().all(|key| of_specimen(&self.dir.join(inside), key).is_some());
        self.items().into_iter().filter_map(|item| item.experiment).filter(has_all).collect()
    }

    fn item(&self, name: String, experiment: Option<PathBuf>, study: PathBuf) -> Item {
        let mut revisions: Vec<(u32, String)> = folders(&self.dir.join(&study))
            .into_iter()
            .filter_map(|name| Some((name.strip_prefix('m')?.parse::<u32>().ok()?, name)))
            .collect();
        revisions.sort();
        let revisions = revisions.into_iter().map(|(_, name)| name).collect();
        Item { name, experiment, study, revisions, figures: Vec::new() }
    }

    /// Finds an item by its name. Paths that are not items are never opened.
    pub fn find(&self, name: &str) -> Result<Item> {
        self.items().into_iter().find(|item| item.name == name).ok_or_else(|| {
            Error::input(
                InputPlace::file(&self.dir),
                format!("there is no experiment or study `{name}` in this folder"),
                "choose one from the list, or drop a table",
            )
        })
    }

    /// Path of a file in an item's study. Its extension must be one of `SHOWN`. The path must not leave the study or contain symbolic links.
    pub fn file(&self, item: &Item, path: &str) -> Result<PathBuf> {
        let refused =
            || Error::input(InputPlace::file(path), "this is not a file of the study", "follow the links on the page");
        let inside = Path::new(path);
        let is_shown = inside.extension().and_then(|name| name.to_str()).is_some_and(|name| SHOWN.contains(&name));
        if !(is_shown && inside.components().all(is_plain)) {
            return Err(refused());
        }
        let whole = self.dir.join(&item.study).join(inside);
        if files::is_file(&whole) { Ok(whole) } else { Err(refused()) }
    }

    /// Name for the folder of a new experiment. It is derived from the table's name and not used yet.
    pub fn new_experiment(&self, table: &str) -> String {
        let stem = Path::new(table).file_stem().map_or(String::new(), |stem| stem.to_string_lossy().into_owned());
        let safe = files::safe_name(&stem);
        let numbered = (2..).map(|number| format!("{safe}-{number}"));
        let mut names = std::iter::once(safe.clone()).chain(numbered);
        names.find(|name| self.is_free(name)).unwrap_or(safe)
    }

    /// Hash that changes whenever the list of items or one of the items changes.
    pub fn content_hash(&self) -> u64 {
        use std::hash::{DefaultHasher, Hash, Hasher};
        let mut hasher = DefaultHasher::new();
        for item in self.items() {
            let study = self.dir.join(&item.study);
            let revisions = item.revisions.iter().map(|name| study.join(name));
            let description = item.experiment.iter().map(|inside| self.dir.join(inside).join(DESCRIPTION));
            for path in revisions.chain(description).chain([study.join("ladder.json"), study.join("report.html")]) {
                std::fs::symlink_metadata(path).and_then(|metadata| metadata.modified()).ok().hash(&mut hasher);
            }
            item.name.hash(&mut hasher);
            item.revisions.hash(&mut hasher);
        }
        hasher.finish()
    }
}

/// Whether a part of a path leads to an entry of the folder before it that is not hidden.
pub fn is_plain(part: Component<'_>) -> bool {
    match part {
        Component::Normal(name) => !name.to_string_lossy().starts_with('.'),
        _ => false,
    }
}

/// Whether one of `items` has the study of another one, `item`.
pub fn share_study(items: &[Item], item: &Item) -> bool {
    let is_other = |other: &Item| other.name != item.name && other.study == item.study;
    item.study == Path::new(GROUPS) || items.iter().any(is_other)
}

/// Sorted names of the folders in `dir`, without symbolic links and hidden folders.
fn folders(dir: &Path) -> Vec<String> {
    let entries = files::entries(dir, "").unwrap_or_default().into_iter().take(MOST_ENTRIES);
    let folder = |(name, kind): (OsString, FileKind)| {
        name.into_string().ok().filter(|name| kind == FileKind::Folder && !name.starts_with('.'))
    };
    entries.filter_map(folder).collect()
}

/// Names of the drawings in `dir` and in its folder of figures.
fn drawings(dir: &Path) -> Vec<String> {
    let of = |folder: &str| {
        let entries = files::entries(&dir.join(folder), "").unwrap_or_default().into_iter();
        let names = entries.filter_map(|(name, _)| name.into_string().ok());
        names.filter(|name| name.ends_with(".svg")).map(|name| format!("{folder}{name}")).collect::<Vec<String>>()
    };
    let mut all = [of(""), of("figures/")].concat();
    all.sort();
    all
}

/// Value of the specimen's key `key` in the description in `dir`; `None` if it is not given.
fn of_specimen(dir: &Path, key: &str) -> Option<String> {
    let bytes = files::read_if_there(&dir.join(DESCRIPTION), Content::Settings)?;
    let table: toml::Table = toml::from_str(std::str::from_utf8(&bytes).ok()?).ok()?;
    Some(table.get("specimen")?.get(key)?.as_str()?.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Creates a workbench folder that contains a study with a revision, and an experiment. A secret file lies outside.
    fn place() -> (tempfile::TempDir, WorkbenchFolder) {
        let place = tempfile::tempdir().unwrap();
        let put = |path: &str, text: &str| {
            let path = place.path().join(path);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        };
        put("secret.json", "{}");
        put("home/eye/experiment.toml", "[specimen]\nid = \"left eye\"\n");
        put("home/vitreo-uq-out/left-eye/inputs.sha256", "");
        put("home/vitreo-uq-out/left-eye/m0/posterior.json", "{}");
        put("home/vitreo-uq-out/left-eye/m10/posterior.json", "{}");
        put("home/vitreo-uq-out/left-eye/m2/posterior.json", "{}");
        put("home/vitreo-uq-out/left-eye/.hidden.json", "{}");
        put("home/vitreo-uq-out/other/inputs.sha256", "");
        let home = WorkbenchFolder::in_folder(place.path().join("home"));
        (place, home)
    }

    #[test]
    fn an_experiment_and_its_study_are_one_item() {
        let (_place, home) = place();
        let items = home.items();
        let names: Vec<&str> = items.iter().map(|item| item.name.as_str()).collect();
        assert_eq!(names, ["eye", "vitreo-uq-out/other"]);
        assert_eq!(items[0].study, Path::new("vitreo-uq-out/left-eye"));
        assert_eq!(items[0].revisions, ["m0", "m2", "m10"]);
        for name in ["../secret", "vitreo-uq-out/../.."] {
            let error = home.find(name).err().unwrap().to_string();
            assert!(error.contains(&format!("there is no experiment or study `{name}` in this folder")), "{error}");
        }
        let (found, name) = WorkbenchFolder::of(&home.dir.join("vitreo-uq-out/left-eye")).unwrap();
        assert_eq!(name.as_deref(), Some("eye"));
        assert_eq!(found.dir(), std::fs::canonicalize(&home.dir).unwrap());
    }

    #[test]
    fn nothing_outside_a_study_is_read() {
        let (place, home) = place();
        let item = home.find("eye").unwrap();
        assert!(home.file(&item, "m0/posterior.json").is_ok());
        let whole = place.path().join("secret.json");
        for path in [
            "../secret.json",
            "../../../secret.json",
            "m0/../../../../secret.json",
            whole.to_str().unwrap(),
            ".hidden.json",
            "inputs.sha256",
            "m0",
            "m0/none.json",
            "",
            "m0/posterior.json\0",
        ] {
            let error = home.file(&item, path).unwrap_err().to_string();
            assert!(error.contains("this is not a file of the study"), "{path}: {error}");
        }
        #[cfg(unix)]
        {
            let link = home.dir.join(&item.study).join("m0/link.json");
            std::os::unix::fs::symlink(&whole, link).unwrap();
            assert!(
                home.file(&item, "m0/link.json")
                    .is_err_and(|error| error.to_string().contains("this is not a file of the study"))
            );
        }
    }

    #[test]
    fn a_new_experiment_writes_over_nothing() {
        let (_place, home) = place();
        assert_eq!(home.new_experiment("眼睛 1.csv"), "眼睛-1");
        assert_eq!(home.new_experiment("eye.csv"), "eye-2");
        assert_eq!(home.new_experiment("../../x.csv"), "x");
        assert_eq!(home.new_experiment("vitreo-uq-out.csv"), "vitreo-uq-out-2");
    }
}
