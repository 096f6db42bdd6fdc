//! Directories that are kept open. Their entries are opened, created, renamed and removed by name, and links are not followed.

use std::ffi::{OsStr, OsString};
use std::fs::File;
use std::io::Result;
use std::path::Path;

/// Kind of a directory entry.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileKind {
    /// Regular file.
    File,
    /// Directory.
    Folder,
    /// Symbolic link.
    Link,
    /// Pipe, socket or device.
    Other,
}

pub(super) use system::Folder;

impl Folder {
    /// Removes the entry `name`. A directory is removed with its content, and a link without its target.
    pub fn remove_all(&self, name: &OsStr) -> Result<()> {
        if self.kind(name)? != FileKind::Folder {
            return self.remove_file(name);
        }
        let inner = self.inside(name)?;
        for (name, _) in inner.entries()? {
            inner.remove_all(&name)?;
        }
        self.remove_folder(name)
    }
}

/// Implementation that keeps directories open by a file descriptor. Nobody can redirect a later access by replacing a directory in the path with a link.
#[cfg(any(target_os = "linux", target_vendor = "apple"))]
mod system {
    use super::*;
    use rustix::fd::OwnedFd;
    use rustix::fs::{AtFlags, Dir, FileType, Mode, OFlags, RenameFlags};
    use rustix::fs::{fsync, mkdirat, open, openat, renameat, renameat_with, statat, unlinkat};
    use std::os::unix::ffi::OsStrExt;

    const FOLDER: OFlags = OFlags::RDONLY.union(OFlags::DIRECTORY).union(OFlags::CLOEXEC);
    /// Flags for opening an entry without following links. `NONBLOCK` prevents waiting for a writer when the entry is a pipe.
    const PLAIN: OFlags = OFlags::NOFOLLOW.union(OFlags::NONBLOCK).union(OFlags::CLOEXEC);

    /// Open directory, as a file descriptor.
    #[derive(Debug)]
    pub struct Folder(OwnedFd);

    impl Folder {
        /// Opens a directory by its path. Links are followed.
        pub fn open(path: &Path) -> Result<Self> {
            Ok(Self(open(path, FOLDER, Mode::empty())?))
        }

        /// Opens the subdirectory `name`, unless it is a link.
        pub fn inside(&self, name: &OsStr) -> Result<Self> {
            Ok(Self(openat(&self.0, name, FOLDER | OFlags::NOFOLLOW, Mode::empty())?))
        }

        /// Kind of the entry `name`.
        pub fn kind(&self, name: &OsStr) -> Result<FileKind> {
            Ok(kind_of(FileType::from_raw_mode(statat(&self.0, name, AtFlags::SYMLINK_NOFOLLOW)?.st_mode)))
        }

        /// Opens the entry `name` for reading, unless it is a link.
        pub fn read(&self, name: &OsStr) -> Result<File> {
            Ok(openat(&self.0, name, OFlags::RDONLY | PLAIN, Mode::empty())?.into())
        }

        /// Opens the file `name` for writing without changing its content. Creates it if it does not exist.
        pub fn write(&self, name: &OsStr) -> Result<File> {
            Ok(openat(&self.0, name, OFlags::WRONLY | OFlags::CREATE | PLAIN, Mode::from_raw_mode(0o666))?.into())
        }

        /// Creates the file `name`. Fails if the entry exists.
        pub fn create_new(&self, name: &OsStr) -> Result<File> {
            let flags = OFlags::RDWR | OFlags::CREATE | OFlags::EXCL | PLAIN;
            Ok(openat(&self.0, name, flags, Mode::from_raw_mode(0o666))?.into())
        }

        /// Creates the subdirectory `name`. Fails if the entry exists.
        pub fn create_folder(&self, name: &OsStr) -> Result<()> {
            Ok(mkdirat(&self.0, name, Mode::from_raw_mode(0o777))?)
        }

        /// Lists the entries with their kinds.
        pub fn entries(&self) -> Result<Vec<(OsString, FileKind)>> {
            let mut all = Vec::new();
            for entry in Dir::read_from(&self.0)? {
                let entry = entry?;
                let name = OsStr::from_bytes(entry.file_name().to_bytes());
                if name == "." || name == ".." {
                    continue;
                }
                let kind = match entry.file_type() {
                    FileType::Unknown => self.kind(name)?,
                    known => kind_of(known),
                };
                all.push((name.to_os_string(), kind));
            }
            Ok(all)
        }

        pub(super) fn remove_file(&self, name: &OsStr) -> Result<()> {
            Ok(unlinkat(&self.0, name, AtFlags::empty())?)
        }

        pub(super) fn remove_folder(&self, name: &OsStr) -> Result<()> {
            Ok(unlinkat(&self.0, name, AtFlags::REMOVEDIR)?)
        }

        /// Renames the entry `name` to the entry `new` of the directory `to`. An existing file is replaced.
        pub fn rename(&self, name: &OsStr, to: &Self, new: &OsStr) -> Result<()> {
            Ok(renameat(&self.0, name, &to.0, new)?)
        }

        /// Exchanges the entry `name` with the entry `other` of the directory `with` in one atomic step.
        pub fn exchange(&self, name: &OsStr, with: &Self, other: &OsStr) -> Result<()> {
            Ok(renameat_with(&self.0, name, &with.0, other, RenameFlags::EXCHANGE)?)
        }

        /// Waits until the names of the entries are written to the disk, so that they survive a power failure.
        pub fn sync(&self) -> Result<()> {
            Ok(fsync(&self.0)?)
        }
    }

    fn kind_of(kind: FileType) -> FileKind {
        match kind {
            FileType::RegularFile => FileKind::File,
            FileType::Directory => FileKind::Folder,
            FileType::Symlink => FileKind::Link,
            _ => FileKind::Other,
        }
    }
}

/// Implementation for systems on which the program cannot keep directories open. A directory is a path, which is checked before each use.
#[cfg(not(any(target_os = "linux", target_vendor = "apple")))]
mod system {
    use super::*;
    use std::fs::{self, OpenOptions};
    use std::io::{Error, ErrorKind};
    use std::path::PathBuf;

    /// Path of a directory.
    #[derive(Debug)]
    pub struct Folder(PathBuf);

    impl Folder {
        /// Opens a directory by its path. Links are followed.
        pub fn open(path: &Path) -> Result<Self> {
            fs::read_dir(path).map(|_| Self(path.to_path_buf()))
        }

        /// Opens the subdirectory `name`, unless it is a link.
        pub fn inside(&self, name: &OsStr) -> Result<Self> {
            self.refuse_link(name)?;
            Self::open(&self.0.join(name))
        }

        /// Kind of the entry `name`.
        pub fn kind(&self, name: &OsStr) -> Result<FileKind> {
            let own = self.0.join(name).symlink_metadata()?.file_type();
            Ok(match () {
                () if own.is_symlink() => FileKind::Link,
                () if own.is_dir() => FileKind::Folder,
                () if own.is_file() => FileKind::File,
                () => FileKind::Other,
            })
        }

        /// Opens the entry `name` for reading, unless it is a link.
        pub fn read(&self, name: &OsStr) -> Result<File> {
            self.refuse_link(name)?;
            File::open(self.0.join(name))
        }

        /// Opens the file `name` for writing without changing its content. Creates it if it does not exist.
        pub fn write(&self, name: &OsStr) -> Result<File> {
            self.refuse_link(name)?;
            OpenOptions::new().write(true).create(true).truncate(false).open(self.0.join(name))
        }

        /// Creates the file `name`. Fails if the entry exists.
        pub fn create_new(&self, name: &OsStr) -> Result<File> {
            OpenOptions::new().read(true).write(true).create_new(true).open(self.0.join(name))
        }

        /// Creates the subdirectory `name`. Fails if the entry exists.
        pub fn create_folder(&self, name: &OsStr) -> Result<()> {
            fs::create_dir(self.0.join(name))
        }

        /// Lists the entries with their kinds.
        pub fn entries(&self) -> Result<Vec<(OsString, FileKind)>> {
            fs::read_dir(&self.0)?
                .map(|entry| entry.and_then(|own| Ok((own.file_name(), self.kind(&own.file_name())?))))
                .collect()
        }

        pub(super) fn remove_file(&self, name: &OsStr) -> Result<()> {
            let path = self.0.join(name);
            // On Windows, a link to a directory must be removed like a directory.
            fs::remove_file(&path).or_else(|error| fs::remove_dir(&path).map_err(|_| error))
        }

        pub(super) fn remove_folder(&self, name: &OsStr) -> Result<()> {
            fs::remove_dir(self.0.join(name))
        }

        /// Renames the entry `name` to the entry `new` of the directory `to`. An existing file is replaced.
        pub fn rename(&self, name: &OsStr, to: &Self, new: &OsStr) -> Result<()> {
            fs::rename(self.0.join(name), to.0.join(new))
        }

        /// Returns an error, because these systems cannot exchange two entries in one step.
        pub fn exchange(&self, _: &OsStr, _: &Self, _: &OsStr) -> Result<()> {
            Err(ErrorKind::Unsupported.into())
        }

        /// Does nothing: only Unix has a request that writes a directory's names to the disk.
        pub fn sync(&self) -> Result<()> {
            Ok(())
        }

        fn refuse_link(&self, name: &OsStr) -> Result<()> {
            match self.kind(name) {
                Ok(FileKind::Link) => Err(Error::new(ErrorKind::InvalidInput, "this is a symbolic link")),
                _ => Ok(()),
            }
        }
    }
}
