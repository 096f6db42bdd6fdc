//! Directories whose content may come from another person. Symbolic links inside them are never followed.
//!
//! A received study is untrusted data. The user names its directory, perhaps by a path with links. From that directory on, the program opens each part of
//! a path by name and refuses a link. A link inserted during the access is refused as well, because each step opens exactly the entry that it checks
//! ([`Folder`]). [`forbid_links`] declares such a directory. Afterwards all functions of [`super`] apply this rule to paths inside it.

use std::ffi::{OsStr, OsString};
use std::fs::File;
use std::io::{self, ErrorKind};
use std::path::{Component, Path, PathBuf};
use std::sync::{PoisonError, RwLock};

use super::folder::{FileKind, Folder};
use super::{REMEDY, folder_of};
use crate::error::{Error, InputPlace, Result};

/// Prefix of this program's own hidden names in a user's folder.
const PROGRAM: &str = ".vitreo-uq";

static ENCLOSED: RwLock<Vec<Enclosed>> = RwLock::new(Vec::new());

#[derive(Debug, Clone, PartialEq, Eq)]
struct Enclosed {
    root: PathBuf,
    /// Description of the directory in messages, such as "a study".
    what: &'static str,
    /// `true` for a user's folder. Links in other programs' hidden directories inside such a folder, such as caches, may be followed.
    is_folder_of_user: bool,
}

/// Declares that a directory may come from another person. From now on, no link inside it is followed. `what` describes the directory in
/// messages ("a study").
pub fn forbid_links(root: &Path, what: &'static str) {
    add(root, what, false);
}

/// Forbids links inside a user's folder of experiments and studies, like [`forbid_links`]. Hidden directories of other programs in the
/// folder are exempt.
pub fn forbid_links_in_user_folder(root: &Path, what: &'static str) {
    add(root, what, true);
}

fn add(root: &Path, what: &'static str, is_folder_of_user: bool) {
    let mut all = ENCLOSED.write().unwrap_or_else(PoisonError::into_inner);
    for root in [std::path::absolute(root).ok(), root.canonicalize().ok()].into_iter().flatten() {
        let enclosed = Enclosed { root, what, is_folder_of_user };
        if !all.contains(&enclosed) {
            all.push(enclosed);
        }
    }
}

/// Reason why a path was not opened.
#[derive(Debug)]
pub(super) enum Refusal {
    Link {
        path: PathBuf,
        what: &'static str,
    },
    /// The path leads out of the directory through `..`.
    Out {
        path: PathBuf,
        what: &'static str,
    },
    System(io::Error),
}

impl From<io::Error> for Refusal {
    fn from(error: io::Error) -> Self {
        Self::System(error)
    }
}

impl Refusal {
    /// Converts the refusal to an error. `action` is the verb for the operation that was tried at the path, such as "read".
    pub fn error(self, action: &'static str, path: &Path, remedy: &str) -> Error {
        match self {
            Self::Link { path, what } => Error::input(
                InputPlace::file(path),
                format!("this is a symbolic link; links inside {what} are not followed"),
                "put a copy of the file or directory in the link's place, if you trust it; or remove the link",
            ),
            Self::Out { path, what } => Error::input(
                InputPlace::file(path),
                format!("this path leads out of {what}"),
                "name files inside it, without `..`",
            ),
            Self::System(source) => Error::at_path(action, path, source, remedy),
        }
    }
}

type Opened<T> = std::result::Result<T, Refusal>;

/// Finds the outermost directory that contains a path and in which links are forbidden. Returns the directory and the names that lead from
/// it to the path; `None` outside all such directories.
fn placed(path: &Path) -> Opened<Option<(Enclosed, Vec<OsString>)>> {
    let full = std::path::absolute(path)?;
    let all = ENCLOSED.read().unwrap_or_else(PoisonError::into_inner);
    let is_content = |enclosed: &&Enclosed| {
        let Ok(inside) = full.strip_prefix(&enclosed.root) else { return false };
        let hidden = inside.components().next().map(|first| first.as_os_str().to_string_lossy().into_owned());
        !enclosed.is_folder_of_user || hidden.is_none_or(|name| !name.starts_with('.') || name.starts_with(PROGRAM))
    };
    let outermost = all.iter().filter(is_content).min_by_key(|enclosed| enclosed.root.components().count());
    let Some(entry) = outermost.cloned() else { return Ok(None) };
    drop(all);
    match names_of(full.strip_prefix(&entry.root).unwrap_or(&full)) {
        Some(names) => Ok(Some((entry, names))),
        None => Err(Refusal::Out { path: path.to_path_buf(), what: entry.what }),
    }
}

/// Returns `true` if a path lies inside a directory in which links are forbidden.
pub(super) fn is_enclosed(path: &Path) -> bool {
    !matches!(placed(path), Ok(None))
}

/// Opens the subdirectory `name` of `folder`. If the entry is a link, the error shows the path `path`.
fn step(folder: &Folder, name: &OsStr, path: &Path, what: &'static str) -> Opened<Folder> {
    folder.inside(name).map_err(|error| match folder.kind(name) {
        Ok(FileKind::Link) => Refusal::Link { path: path.to_path_buf(), what },
        _ => Refusal::System(error),
    })
}

/// Opens the directory that is reached from `enclosed` through the subdirectories `names`, without following links.
fn walk(enclosed: &Enclosed, names: &[OsString]) -> Opened<Folder> {
    let (mut folder, mut place) = (Folder::open(&enclosed.root)?, enclosed.root.clone());
    for name in names {
        place.push(name);
        folder = step(&folder, name, &place, enclosed.what)?;
    }
    Ok(folder)
}

/// Opens a directory. Links are refused inside directories in which they are forbidden, and followed elsewhere.
pub(super) fn folder(path: &Path) -> Opened<Folder> {
    match placed(path)? {
        Some((enclosed, names)) => walk(&enclosed, &names),
        None => Ok(Folder::open(path)?),
    }
}

/// Opens the parent directory of a path. Returns it with the last name of the path.
pub(super) fn parent(path: &Path) -> Opened<(Folder, OsString)> {
    let name = path.file_name().ok_or_else(|| io::Error::new(ErrorKind::InvalidInput, "this path has no file name"))?;
    Ok((folder(folder_of(path))?, name.to_os_string()))
}

/// Returns the refusal for a link at a path.
fn link(path: &Path) -> Refusal {
    let what = placed(path).ok().flatten().map_or("this directory", |(enclosed, _)| enclosed.what);
    Refusal::Link { path: path.to_path_buf(), what }
}

/// Kind of the entry at a path; `None` if there is no accessible entry. A link is reported as a link where links are forbidden
/// ([`forbid_links`]), and followed elsewhere.
pub fn kind(path: &Path) -> Option<FileKind> {
    found(path).ok()
}

fn found(path: &Path) -> Opened<FileKind> {
    match placed(path)? {
        Some((_, names)) if !names.is_empty() => {
            let (folder, name) = parent(path)?;
            Ok(folder.kind(&name)?)
        }
        _ => Ok(kind_through_links(path)?),
    }
}

fn kind_through_links(path: &Path) -> io::Result<FileKind> {
    let metadata = std::fs::metadata(path)?;
    Ok(match () {
        () if metadata.is_dir() => FileKind::Folder,
        () if metadata.is_file() => FileKind::File,
        () => FileKind::Other,
    })
}

/// Returns `true` if a path is a file that [`super::read`] can read.
pub fn is_file(path: &Path) -> bool {
    kind(path) == Some(FileKind::File)
}

/// Returns `true` if a path is a directory that [`entries`] lists.
pub fn is_folder(path: &Path) -> bool {
    kind(path) == Some(FileKind::Folder)
}

/// Returns an error if a path is a link, or leads through a link, where links are forbidden ([`forbid_links`]). A missing path is accepted.
///
/// # Errors
/// [`Error::Input`] that names the link.
pub fn refuse_link(path: &Path) -> Result<()> {
    match found(path) {
        Ok(FileKind::Link) => Err(link(path).error("open", path, REMEDY)),
        Ok(_) | Err(Refusal::System(_)) => Ok(()),
        Err(refusal) => Err(refusal.error("open", path, REMEDY)),
    }
}

/// Lists the entries of a directory: name and kind, sorted by name.
///
/// # Errors
/// [`Error::File`] with `remedy` if the operating system refuses, [`Error::Input`] for a link where links are forbidden.
pub fn entries(path: &Path, remedy: &str) -> Result<Vec<(OsString, FileKind)>> {
    let list = || -> Opened<Vec<(OsString, FileKind)>> {
        let mut all = folder(path)?.entries()?;
        if !is_enclosed(path) {
            for (name, kind) in all.iter_mut().filter(|(_, kind)| *kind == FileKind::Link) {
                // A link without a target keeps the kind `Link`.
                *kind = kind_through_links(&path.join(name)).unwrap_or(FileKind::Link);
            }
        }
        all.sort_by(|a, b| a.0.cmp(&b.0));
        Ok(all)
    };
    list().map_err(|refusal| refusal.error("read", path, remedy))
}

/// Opens a regular file for reading. For any other entry, returns its kind.
pub(super) fn open(path: &Path) -> Opened<std::result::Result<File, FileKind>> {
    match placed(path)? {
        Some((enclosed, names)) if !names.is_empty() => open_beneath(&enclosed, &names),
        _ => match kind_through_links(path)? {
            FileKind::File => Ok(Ok(File::open(path)?)),
            kind => Ok(Err(kind)),
        },
    }
}

/// Opens the file `root/inside` for reading, without following links below `root`. `what` describes `root` in messages.
pub(super) fn open_inside(
    root: &Path,
    inside: &Path,
    what: &'static str,
) -> Opened<std::result::Result<File, FileKind>> {
    let path = root.join(inside);
    let enclosed = Enclosed { root: root.to_path_buf(), what, is_folder_of_user: false };
    match (placed(&path)?, names_of(inside)) {
        (Some(_), _) => open(&path),
        (None, Some(names)) => open_beneath(&enclosed, &names),
        (None, None) => Err(Refusal::Out { path, what }),
    }
}

/// Splits a relative path into its names; `None` if the path has any other part, such as `..`.
fn names_of(inside: &Path) -> Option<Vec<OsString>> {
    let name = |part| match part {
        Component::Normal(name) => Some(name.to_os_string()),
        _ => None,
    };
    inside.components().map(name).collect()
}

fn open_beneath(enclosed: &Enclosed, names: &[OsString]) -> Opened<std::result::Result<File, FileKind>> {
    let Some((name, folders)) = names.split_last() else { return Ok(Err(FileKind::Folder)) };
    let folder = walk(enclosed, folders)?;
    match folder.kind(name)? {
        FileKind::Link => {
            Err(Refusal::Link { path: enclosed.root.join(names.iter().collect::<PathBuf>()), what: enclosed.what })
        }
        FileKind::File => Ok(Ok(folder.read(name)?)),
        kind => Ok(Err(kind)),
    }
}

/// Opens a regular file for reading. This function suits callers that read only part of the file.
///
/// # Errors
/// [`Error::File`] if the operating system refuses, [`Error::Input`] for a link where links are forbidden and for anything but a regular
/// file.
pub fn open_file(path: &Path) -> Result<File> {
    match open(path).map_err(|refusal| refusal.error("read", path, REMEDY))? {
        Ok(file) => Ok(file),
        Err(_) => Err(Error::input(InputPlace::file(path), "this is not a regular file", "remove it")),
    }
}

/// Opens a lock file, and creates it if it does not exist. The file's content is never read or changed.
///
/// # Errors
/// [`Error::File`] if the operating system refuses, [`Error::Input`] for a link or anything but a file.
pub fn open_lock(path: &Path) -> Result<File> {
    let refused = |refusal: Refusal| refusal.error("create", path, REMEDY);
    let (folder, name) = parent(path).map_err(refused)?;
    match folder.kind(&name) {
        Ok(FileKind::Link) => Err(refused(link(path))),
        Ok(FileKind::Folder | FileKind::Other) => Err(Error::input(
            InputPlace::file(path),
            "this must be a regular file, which the program uses as a lock",
            "remove it",
        )),
        _ => folder.write(&name).map_err(|error| refused(error.into())),
    }
}

/// Creates an empty file for writing. An existing file is replaced.
///
/// # Errors
/// [`Error::File`] with `remedy` if the operating system refuses, [`Error::Input`] for a link where links are forbidden.
pub fn create_or_replace(path: &Path, remedy: &str) -> Result<File> {
    let create = || -> Opened<File> {
        let (folder, name) = parent(path)?;
        match folder.kind(&name) {
            Ok(FileKind::Folder) | Err(_) => {}
            Ok(_) => folder.remove_all(&name)?,
        }
        Ok(folder.create_new(&name)?)
    };
    create().map_err(|refusal| refusal.error("create", path, remedy))
}

/// Copies a regular file. An existing file at the target is replaced.
///
/// # Errors
/// Errors of [`super::read`] and [`create_or_replace`].
pub fn copy(from: &Path, to: &Path) -> Result<()> {
    let mut file = open_file(from)?;
    let mut copy = create_or_replace(to, REMEDY)?;
    io::copy(&mut file, &mut copy).map_err(|source| Error::at_path("copy", from, source, REMEDY))?;
    Ok(())
}

/// Creates a directory and its missing parents.
///
/// # Errors
/// [`Error::File`] with `remedy` if the operating system refuses, [`Error::Input`] for a link where links are forbidden.
pub fn create_folders(path: &Path, remedy: &str) -> Result<()> {
    let create = || -> Opened<()> {
        let Some((Enclosed { root, what, .. }, names)) = placed(path)? else {
            return Ok(std::fs::create_dir_all(path)?);
        };
        std::fs::create_dir_all(&root)?;
        let (mut folder, mut place) = (Folder::open(&root)?, root);
        for name in names {
            place.push(&name);
            match folder.create_folder(&name) {
                Err(error) if error.kind() != ErrorKind::AlreadyExists => return Err(error.into()),
                _ => folder = step(&folder, &name, &place, what)?,
            }
        }
        Ok(())
    };
    create().map_err(|refusal| refusal.error("create", path, remedy))
}

/// Removes a file, a link, or a directory with its content. The target of a link stays. A missing entry is accepted.
///
/// # Errors
/// [`Error::File`] if the operating system refuses, [`Error::Input`] for a link where links are forbidden.
pub fn remove_all(path: &Path) -> Result<()> {
    let remove = || -> Opened<()> {
        let (folder, name) = parent(path)?;
        Ok(folder.remove_all(&name)?)
    };
    match remove() {
        Err(Refusal::System(error)) if error.kind() == ErrorKind::NotFound => Ok(()),
        removed => removed.map_err(|refusal| refusal.error("remove", path, REMEDY)),
    }
}

/// Renames the entry at a path to an unused path.
///
/// # Errors
/// Errors of [`remove_all`].
pub fn rename(from: &Path, to: &Path) -> Result<()> {
    change(from, to, Folder::rename)
}

/// Exchanges the entries at two paths in one atomic step. Some systems do not support this and return an error.
///
/// # Errors
/// Errors of [`remove_all`].
pub fn exchange(a: &Path, b: &Path) -> Result<()> {
    change(a, b, Folder::exchange)
}

fn change(from: &Path, to: &Path, change: impl Fn(&Folder, &OsStr, &Folder, &OsStr) -> io::Result<()>) -> Result<()> {
    let work = || -> Opened<()> {
        let ((from, name), (to, new)) = (parent(from)?, parent(to)?);
        Ok(change(&from, &name, &to, &new)?)
    };
    work().map_err(|refusal| refusal.error("replace", to, REMEDY))
}
