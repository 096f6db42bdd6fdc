//! The port and the token of a folder's workbench, which a later workbench of the folder uses again: an open page then goes on by itself.
//!
//! They are stored among the caches of the user and not in the folder, since a folder may come from others, who would know its token.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use vitreo_uq::base::files::{self, Content};
use vitreo_uq::base::sha256::sha256_hex;
use vitreo_uq::posterior::cache::cache_directory;

/// Port and token of a workbench.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Link {
    pub port: u16,
    pub token: String,
}

impl Link {
    /// The link that the last workbench of the folder `home` had; `None` if it is not known, or if others could have read or written it.
    pub fn read(home: &Path) -> Option<Self> {
        let path = path(home)?;
        if !is_private(path.parent()?) {
            return None;
        }
        let link: Self = serde_json::from_slice(&files::read_if_there(&path, Content::Settings)?).ok()?;
        let is_token = link.token.len() == 32 && link.token.bytes().all(|byte| byte.is_ascii_hexdigit());
        is_token.then_some(link)
    }

    /// Stores the link. If that is impossible, the next workbench has another one.
    pub fn store(&self, home: &Path) {
        let Some(path) = path(home) else { return };
        let Some(folder) = path.parent() else { return };
        if files::create_folders(folder, "").is_ok() && make_private(folder) {
            let _ = files::write_json_atomically(&path, self);
        }
    }
}

fn path(home: &Path) -> Option<PathBuf> {
    let name = sha256_hex(home.as_os_str().as_encoded_bytes());
    Some(cache_directory()?.join("workbench").join(format!("{}.json", &name[..32])))
}

/// Whether only this user can open the folder.
#[cfg(any(target_os = "linux", target_vendor = "apple"))]
fn is_private(folder: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    std::fs::symlink_metadata(folder).is_ok_and(|metadata| {
        metadata.is_dir() && metadata.mode() & 0o77 == 0 && metadata.uid() == rustix::process::geteuid().as_raw()
    })
}

/// Caches of a Windows user are private by default. On other systems this is not known.
#[cfg(not(any(target_os = "linux", target_vendor = "apple")))]
fn is_private(_: &Path) -> bool {
    cfg!(windows)
}

/// Lets only this user open the folder, and says whether that succeeded.
fn make_private(folder: &Path) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        let _ = std::fs::set_permissions(folder, std::fs::Permissions::from_mode(0o700));
    }
    is_private(folder)
}
