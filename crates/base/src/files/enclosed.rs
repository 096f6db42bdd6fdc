//! Directories whose content may come from somebody else: nothing beneath them is reached through a link.
//!
//! A study that was received is data. The user names its directory, perhaps by a link. What lies beneath is opened name by name from that directory, and a link on the way
//! is refused. A link that is put there in the meantime is refused, too, because each step opens what it looks at ([`Folder`]).
//! [`enclose`] declares such a directory. From then on all functions of [`super`] keep to the rule for paths beneath it, whoever calls them.

use std::ffi::{OsStr, OsString};
use std::fs::File;
use std::io::{self, ErrorKind};
use std::path::{Component, Path, PathBuf};
use std::sync::{PoisonError, RwLock};

use super::folder::{Folder, Kind};
use super::{REMEDY, folder_of};
use crate::error::{Error, Place, Result};

/// Beginning of the hidden names that belong to this program in a user's folder.
const PROGRAM: &str = ".vitreo-uq";

static ENCLOSED: RwLock<Vec<Enclosed>> = RwLock::new(Vec::new());

#[derive(Debug, Clone, PartialEq, Eq)]
struct Enclosed {
    root: PathBuf,
    /// What the directory is, for messages.
    what: &'static str,
    /// Whether other programs' hidden directories in it are left out, such as a user's caches.
    is_folder_of_user: bool,
}

/// Declares that a directory, which is `what` ("a study"), holds data: nothing beneath it is reached through a link from now on.
pub fn enclose(root: &Path, what: &'static str) {
    add(root, what, false);
}

/// The same of a user's folder of experiments and studies, but for hidden directories in it that are not this program's.
pub fn enclose_folder(root: &Path, what: &'static str) {
    add(root, what, true);
}

fn add(root: &Path, what: &'static str, is_folder_of_user: bool) {
    let mut all = ENCLOSED.write().unwrap_or_else(PoisonError::into_inner);
    for root in [std::path::absolute(root).ok(), root.canonicalize().ok()].into_iter().flatten() {
        let own = Enclosed { root, what, is_folder_of_user };
        if !all.contains(&own) {
            all.push(own);
        }
    }
}

/// Why a path is not opened.
#[derive(Debug)]
pub(super) enum Refusal {
    Link {
        path: PathBuf,
        what: &'static str,
    },
    /// The path leads out of the directory by `..`.
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
    /// As an error of an action on a path.
    pub fn error(self, action: &'static str, path: &Path, remedy: &str) -> Error {
        match self {
            Self::Link { path, what } => Error::input(
                Place::file(path),
                format!("this is a symbolic link; links inside {what} are not followed"),
                "put a copy of the file or directory in the link's place, if you trust it; or remove the link",
            ),
            Self::Out { path, what } => Error::input(
                Place::file(path),
                format!("this path leads out of {what}"),
                "name files inside it, without `..`",
            ),
            Self::System(source) => Error::at_path(action, path, source, remedy),
        }
    }
}

type Opened<T> = std::result::Result<T, Refusal>;

/// The outermost enclosed directory that a path lies beneath, and the names that lead from there.
fn placed(path: &Path) -> Opened<Option<(Enclosed, Vec<OsString>)>> {
    let full = std::path::absolute(path)?;
    let all = ENCLOSED.read().unwrap_or_else(PoisonError::into_inner);
    let is_content = |own: &&Enclosed| {
        let Ok(inside) = full.strip_prefix(&own.root) else { return false };
        let hidden = inside.components().next().map(|first| first.as_os_str().to_string_lossy().into_owned());
        !own.is_folder_of_user || hidden.is_none_or(|name| !name.starts_with('.') || name.starts_with(PROGRAM))
    };
    let outermost = all.iter().filter(is_content).min_by_key(|own| own.root.components().count());
    let Some(own) = outermost.cloned() else { return Ok(None) };
    drop(all);
    match names_of(full.strip_prefix(&own.root).unwrap_or(&full)) {
        Some(names) => Ok(Some((own, names))),
        None => Err(Refusal::Out { path: path.to_path_buf(), what: own.what }),
    }
}

/// Whether a path lies beneath an enclosed directory.
pub(super) fn is_enclosed(path: &Path) -> bool {
    !matches!(placed(path), Ok(None))
}

/// One name further, with the link named that may stand there.
fn step(folder: &Folder, name: &OsStr, path: &Path, what: &'static str) -> Opened<Folder> {
    folder.inside(name).map_err(|error| match folder.kind(name) {
        Ok(Kind::Link) => Refusal::Link { path: path.to_path_buf(), what },
        _ => Refusal::System(error),
    })
}

/// Opens the directory that names lead to from an enclosed one.
fn walk(own: &Enclosed, names: &[OsString]) -> Opened<Folder> {
    let (mut folder, mut place) = (Folder::open(&own.root)?, own.root.clone());
    for name in names {
        place.push(name);
        folder = step(&folder, name, &place, own.what)?;
    }
    Ok(folder)
}

/// Opens a directory.
pub(super) fn folder(path: &Path) -> Opened<Folder> {
    match placed(path)? {
        Some((own, names)) => walk(&own, &names),
        None => Ok(Folder::open(path)?),
    }
}

/// Opens the directory that a path stands in; with the path's name there.
pub(super) fn parent(path: &Path) -> Opened<(Folder, OsString)> {
    let name = path.file_name().ok_or_else(|| io::Error::new(ErrorKind::InvalidInput, "this path has no file name"))?;
    Ok((folder(folder_of(path))?, name.to_os_string()))
}

/// The refusal of a link that stands at a path.
fn link(path: &Path) -> Refusal {
    let what = placed(path).ok().flatten().map_or("this directory", |(own, _)| own.what);
    Refusal::Link { path: path.to_path_buf(), what }
}

/// What stands at a path; beneath an enclosed directory a link is a link, elsewhere what it leads to. `None` where nothing can be seen.
pub fn kind(path: &Path) -> Option<Kind> {
    found(path).ok()
}

fn found(path: &Path) -> Opened<Kind> {
    match placed(path)? {
        Some((_, names)) if !names.is_empty() => {
            let (folder, name) = parent(path)?;
            Ok(folder.kind(&name)?)
        }
        _ => Ok(kind_through_links(path)?),
    }
}

fn kind_through_links(path: &Path) -> io::Result<Kind> {
    let own = std::fs::metadata(path)?;
    Ok(match () {
        () if own.is_dir() => Kind::Folder,
        () if own.is_file() => Kind::File,
        () => Kind::Other,
    })
}

/// Whether a path is a file that can be read by [`super::read`].
pub fn is_file(path: &Path) -> bool {
    kind(path) == Some(Kind::File)
}

/// Whether a path is a directory that [`entries`] lists.
pub fn is_folder(path: &Path) -> bool {
    kind(path) == Some(Kind::Folder)
}

/// Refuses a path beneath an enclosed directory that is a link, or leads over one.
///
/// # Errors
/// [`Error::Input`] that names the link. What is not there is not refused.
pub fn refuse_link(path: &Path) -> Result<()> {
    match found(path) {
        Ok(Kind::Link) => Err(link(path).error("open", path, REMEDY)),
        Ok(_) | Err(Refusal::System(_)) => Ok(()),
        Err(refusal) => Err(refusal.error("open", path, REMEDY)),
    }
}

/// Names in a directory with what stands under each, in the order of the names.
///
/// # Errors
/// [`Error::File`] with `remedy` if the operating system refuses, [`Error::Input`] where a link beneath an enclosed directory leads there.
pub fn entries(path: &Path, remedy: &str) -> Result<Vec<(OsString, Kind)>> {
    let list = || -> Opened<Vec<(OsString, Kind)>> {
        let mut all = folder(path)?.entries()?;
        if !is_enclosed(path) {
            for (name, kind) in all.iter_mut().filter(|(_, kind)| *kind == Kind::Link) {
                // A broken link stays one.
                *kind = kind_through_links(&path.join(name)).unwrap_or(Kind::Link);
            }
        }
        all.sort_by(|a, b| a.0.cmp(&b.0));
        Ok(all)
    };
    list().map_err(|refusal| refusal.error("read", path, remedy))
}

/// Opens a path to read it, or says what it is where that is no regular file.
pub(super) fn open(path: &Path) -> Opened<std::result::Result<File, Kind>> {
    match placed(path)? {
        Some((own, names)) if !names.is_empty() => open_beneath(&own, &names),
        _ => match kind_through_links(path)? {
            Kind::File => Ok(Ok(File::open(path)?)),
            kind => Ok(Err(kind)),
        },
    }
}

/// The same of a path beneath a directory that is `what`, as if that were enclosed.
pub(super) fn open_inside(root: &Path, inside: &Path, what: &'static str) -> Opened<std::result::Result<File, Kind>> {
    let path = root.join(inside);
    let own = Enclosed { root: root.to_path_buf(), what, is_folder_of_user: false };
    match (placed(&path)?, names_of(inside)) {
        (Some(_), _) => open(&path),
        (None, Some(names)) => open_beneath(&own, &names),
        (None, None) => Err(Refusal::Out { path, what }),
    }
}

/// Names of a path that leads nowhere else.
fn names_of(inside: &Path) -> Option<Vec<OsString>> {
    let name = |part| match part {
        Component::Normal(name) => Some(name.to_os_string()),
        _ => None,
    };
    inside.components().map(name).collect()
}

fn open_beneath(own: &Enclosed, names: &[OsString]) -> Opened<std::result::Result<File, Kind>> {
    let Some((name, folders)) = names.split_last() else { return Ok(Err(Kind::Folder)) };
    let folder = walk(own, folders)?;
    match folder.kind(name)? {
        Kind::Link => Err(Refusal::Link { path: own.root.join(names.iter().collect::<PathBuf>()), what: own.what }),
        Kind::File => Ok(Ok(folder.read(name)?)),
        kind => Ok(Err(kind)),
    }
}

/// Opens a regular file to read parts of it.
///
/// # Errors
/// [`Error::File`] if the operating system refuses, [`Error::Input`] for a link beneath an enclosed directory, and for what is no regular file.
pub fn open_file(path: &Path) -> Result<File> {
    match open(path).map_err(|refusal| refusal.error("read", path, REMEDY))? {
        Ok(file) => Ok(file),
        Err(_) => Err(Error::input(Place::file(path), "this is no regular file", "remove it")),
    }
}

/// Opens a file whose lock is taken: its content is never read or changed, and it is made if it is not there.
///
/// # Errors
/// [`Error::File`] if the operating system refuses, [`Error::Input`] for a link or what is no file.
pub fn open_lock(path: &Path) -> Result<File> {
    let refused = |refusal: Refusal| refusal.error("create", path, REMEDY);
    let (folder, name) = parent(path).map_err(refused)?;
    match folder.kind(&name) {
        Ok(Kind::Link) => Err(refused(link(path))),
        Ok(Kind::Folder | Kind::Other) => {
            Err(Error::input(Place::file(path), "this is not the file that this program keeps here", "remove it"))
        }
        _ => folder.write(&name).map_err(|error| refused(error.into())),
    }
}

/// Makes a file, in the place of one that is there.
///
/// # Errors
/// [`Error::File`] with `remedy` if the operating system refuses, [`Error::Input`] where a link beneath an enclosed directory leads there.
pub fn create_anew(path: &Path, remedy: &str) -> Result<File> {
    let create = || -> Opened<File> {
        let (folder, name) = parent(path)?;
        match folder.kind(&name) {
            Ok(Kind::Folder) | Err(_) => {}
            Ok(_) => folder.remove_all(&name)?,
        }
        Ok(folder.create_new(&name)?)
    };
    create().map_err(|refusal| refusal.error("create", path, remedy))
}

/// Copies a regular file to where nothing is, or in the place of a file.
///
/// # Errors
/// As [`super::read`] and [`create_anew`].
pub fn copy(from: &Path, to: &Path) -> Result<()> {
    let mut file = open_file(from)?;
    let mut copy = create_anew(to, REMEDY)?;
    io::copy(&mut file, &mut copy).map_err(|source| Error::at_path("copy", from, source, REMEDY))?;
    Ok(())
}

/// Makes a directory with those that it stands in, where they are not there.
///
/// # Errors
/// [`Error::File`] with `remedy` if the operating system refuses, [`Error::Input`] where a link beneath an enclosed directory stands in the way.
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

/// Removes what stands at a path, a directory with all that it holds; a link is removed, not what it leads to. Nothing need be there.
///
/// # Errors
/// [`Error::File`] if the operating system refuses, [`Error::Input`] where a link beneath an enclosed directory leads there.
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

/// Renames what stands at a path to where nothing is.
///
/// # Errors
/// As [`remove_all`].
pub fn rename(from: &Path, to: &Path) -> Result<()> {
    change(from, to, Folder::rename)
}

/// Lets what stands at two paths change places, in one step; some systems cannot.
///
/// # Errors
/// As [`remove_all`].
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
