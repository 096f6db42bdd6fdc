//! Directories that are held open: what stands in one is opened, made, renamed and removed from it by name, and never through a link.

use std::ffi::{OsStr, OsString};
use std::fs::File;
use std::io::Result;
use std::path::Path;

/// What stands under a name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A regular file.
    File,
    /// A directory.
    Folder,
    /// A symbolic link.
    Link,
    /// A pipe, a socket or a device.
    Other,
}

pub(super) use system::Folder;

impl Folder {
    /// Removes what stands under a name, a directory with all that it holds; links are removed, not what they lead to.
    pub fn remove_all(&self, name: &OsStr) -> Result<()> {
        if self.kind(name)? != Kind::Folder {
            return self.remove_file(name);
        }
        let inner = self.inside(name)?;
        for (own, _) in inner.entries()? {
            inner.remove_all(&own)?;
        }
        self.remove_folder(name)
    }
}

/// By handles: between two looks at a name, nobody can put a link in its place.
#[cfg(any(target_os = "linux", target_vendor = "apple"))]
mod system {
    use super::*;
    use rustix::fd::OwnedFd;
    use rustix::fs::{AtFlags, Dir, FileType, Mode, OFlags, RenameFlags};
    use rustix::fs::{fsync, mkdirat, open, openat, renameat, renameat_with, statat, unlinkat};
    use std::os::unix::ffi::OsStrExt;

    const FOLDER: OFlags = OFlags::RDONLY.union(OFlags::DIRECTORY).union(OFlags::CLOEXEC);
    /// Opening a pipe must not wait for somebody at its other end.
    const PLAIN: OFlags = OFlags::NOFOLLOW.union(OFlags::NONBLOCK).union(OFlags::CLOEXEC);

    /// A directory that is held open.
    #[derive(Debug)]
    pub struct Folder(OwnedFd);

    impl Folder {
        /// Opens a directory by its path, through links if there are any.
        pub fn open(path: &Path) -> Result<Self> {
            Ok(Self(open(path, FOLDER, Mode::empty())?))
        }

        /// Opens a directory in this one.
        pub fn inside(&self, name: &OsStr) -> Result<Self> {
            Ok(Self(openat(&self.0, name, FOLDER | OFlags::NOFOLLOW, Mode::empty())?))
        }

        /// What stands under a name.
        pub fn kind(&self, name: &OsStr) -> Result<Kind> {
            Ok(kind_of(FileType::from_raw_mode(statat(&self.0, name, AtFlags::SYMLINK_NOFOLLOW)?.st_mode)))
        }

        /// Opens what is no link to read it.
        pub fn read(&self, name: &OsStr) -> Result<File> {
            Ok(openat(&self.0, name, OFlags::RDONLY | PLAIN, Mode::empty())?.into())
        }

        /// Opens a file to write to it, and leaves it as it is; it is made if it is not there.
        pub fn write(&self, name: &OsStr) -> Result<File> {
            Ok(openat(&self.0, name, OFlags::WRONLY | OFlags::CREATE | PLAIN, Mode::from_raw_mode(0o666))?.into())
        }

        /// Makes a file that is not there.
        pub fn create_new(&self, name: &OsStr) -> Result<File> {
            let flags = OFlags::RDWR | OFlags::CREATE | OFlags::EXCL | PLAIN;
            Ok(openat(&self.0, name, flags, Mode::from_raw_mode(0o666))?.into())
        }

        /// Makes a directory that is not there.
        pub fn create_folder(&self, name: &OsStr) -> Result<()> {
            Ok(mkdirat(&self.0, name, Mode::from_raw_mode(0o777))?)
        }

        /// Names in it, with what stands under each.
        pub fn entries(&self) -> Result<Vec<(OsString, Kind)>> {
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

        /// Renames what stands under a name; a file under the new name is replaced.
        pub fn rename(&self, name: &OsStr, to: &Self, new: &OsStr) -> Result<()> {
            Ok(renameat(&self.0, name, &to.0, new)?)
        }

        /// Lets two names change places, in one step.
        pub fn exchange(&self, name: &OsStr, with: &Self, other: &OsStr) -> Result<()> {
            Ok(renameat_with(&self.0, name, &with.0, other, RenameFlags::EXCHANGE)?)
        }

        /// Makes its names durable.
        pub fn sync(&self) -> Result<()> {
            Ok(fsync(&self.0)?)
        }
    }

    fn kind_of(kind: FileType) -> Kind {
        match kind {
            FileType::RegularFile => Kind::File,
            FileType::Directory => Kind::Folder,
            FileType::Symlink => Kind::Link,
            _ => Kind::Other,
        }
    }
}

/// By paths, each looked at before it is used: systems of which this program knows no handles of directories.
#[cfg(not(any(target_os = "linux", target_vendor = "apple")))]
mod system {
    use super::*;
    use std::fs::{self, OpenOptions};
    use std::io::{Error, ErrorKind};
    use std::path::PathBuf;

    /// A directory, by its path.
    #[derive(Debug)]
    pub struct Folder(PathBuf);

    impl Folder {
        /// Opens a directory by its path, through links if there are any.
        pub fn open(path: &Path) -> Result<Self> {
            fs::read_dir(path).map(|_| Self(path.to_path_buf()))
        }

        /// Opens a directory in this one.
        pub fn inside(&self, name: &OsStr) -> Result<Self> {
            self.refuse_link(name)?;
            Self::open(&self.0.join(name))
        }

        /// What stands under a name.
        pub fn kind(&self, name: &OsStr) -> Result<Kind> {
            let own = self.0.join(name).symlink_metadata()?.file_type();
            Ok(match () {
                () if own.is_symlink() => Kind::Link,
                () if own.is_dir() => Kind::Folder,
                () if own.is_file() => Kind::File,
                () => Kind::Other,
            })
        }

        /// Opens what is no link to read it.
        pub fn read(&self, name: &OsStr) -> Result<File> {
            self.refuse_link(name)?;
            File::open(self.0.join(name))
        }

        /// Opens a file to write to it, and leaves it as it is; it is made if it is not there.
        pub fn write(&self, name: &OsStr) -> Result<File> {
            self.refuse_link(name)?;
            OpenOptions::new().write(true).create(true).truncate(false).open(self.0.join(name))
        }

        /// Makes a file that is not there.
        pub fn create_new(&self, name: &OsStr) -> Result<File> {
            OpenOptions::new().read(true).write(true).create_new(true).open(self.0.join(name))
        }

        /// Makes a directory that is not there.
        pub fn create_folder(&self, name: &OsStr) -> Result<()> {
            fs::create_dir(self.0.join(name))
        }

        /// Names in it, with what stands under each.
        pub fn entries(&self) -> Result<Vec<(OsString, Kind)>> {
            fs::read_dir(&self.0)?
                .map(|entry| entry.and_then(|own| Ok((own.file_name(), self.kind(&own.file_name())?))))
                .collect()
        }

        pub(super) fn remove_file(&self, name: &OsStr) -> Result<()> {
            let path = self.0.join(name);
            // A link to a directory is a directory to Windows.
            fs::remove_file(&path).or_else(|error| fs::remove_dir(&path).map_err(|_| error))
        }

        pub(super) fn remove_folder(&self, name: &OsStr) -> Result<()> {
            fs::remove_dir(self.0.join(name))
        }

        /// Renames what stands under a name; a file under the new name is replaced.
        pub fn rename(&self, name: &OsStr, to: &Self, new: &OsStr) -> Result<()> {
            fs::rename(self.0.join(name), to.0.join(new))
        }

        /// Lets two names change places, in one step: these systems have none.
        pub fn exchange(&self, _: &OsStr, _: &Self, _: &OsStr) -> Result<()> {
            Err(ErrorKind::Unsupported.into())
        }

        /// Makes its names durable: only Unix can.
        pub fn sync(&self) -> Result<()> {
            Ok(())
        }

        fn refuse_link(&self, name: &OsStr) -> Result<()> {
            match self.kind(name) {
                Ok(Kind::Link) => Err(Error::new(ErrorKind::InvalidInput, "this is a symbolic link")),
                _ => Ok(()),
            }
        }
    }
}
