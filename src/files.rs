//! Reads regular files alone, and writes files so that no reader sees a partial one.

use std::collections::HashSet;
use std::fs::{self, File};
use std::io::{BufWriter, Error, ErrorKind, Read, Result, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use tempfile::NamedTempFile;

/// Start of the name that a file has until it is whole.
const UNFINISHED: &str = ".unfinished-";

/// Opens a file that is to be read. Named pipes, devices and sockets are refused: without a writer, or an end, the
/// program would wait for ever. A pipe that a shell hands over on purpose (`/dev/stdin`, or `/dev/fd/N` of a process
/// substitution) is taken.
pub fn open(path: &Path) -> Result<File> {
    let mut options = File::options();
    options.read(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::custom_flags(&mut options, libc::O_NONBLOCK);
    let file = options.open(path)?;
    let kind = file.metadata()?.file_type();
    if kind.is_file() {
        return Ok(file);
    }
    if kind.is_dir() {
        return Err(Error::from_raw_os_error(libc::EISDIR));
    }
    #[cfg(unix)]
    if std::os::unix::fs::FileTypeExt::is_fifo(&kind)
        && ["/dev/stdin", "/dev/fd", "/proc/self/fd"].iter().any(|place| path.starts_with(place))
    {
        return File::open(path);
    }
    Err(Error::new(ErrorKind::InvalidInput, "it is a pipe or a device, not a regular file"))
}

/// The content of a file that [`open`] takes.
pub fn read(path: &Path) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open(path)?.read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Identity of a file, equal for all paths that lead to it.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Identity {
    /// Device and inode of a file that exists.
    Inode(u64, u64),
    /// Folder, without links, and name of one that does not.
    Path(PathBuf),
}

/// Which file a path leads to, through links; `None` for devices, pipes and what has no name.
pub fn identity(path: &Path) -> Option<Identity> {
    if let Ok(about) = fs::metadata(path) {
        #[cfg(unix)]
        return about.is_file().then(|| {
            use std::os::unix::fs::MetadataExt;
            Identity::Inode(about.dev(), about.ino())
        });
        #[cfg(not(unix))]
        return about.is_file().then(|| fs::canonicalize(path).ok().map(Identity::Path)).flatten();
    }
    let path = destination(path).ok()?;
    Some(Identity::Path(fs::canonicalize(folder_of(&path)).ok()?.join(path.file_name()?)))
}

/// Fails where [`replace_with`] could not write a file, so that this is known before the work whose result it is.
pub fn check_writable(path: &Path) -> Result<()> {
    match fs::metadata(path) {
        Ok(about) if about.is_dir() => return Err(Error::other("it is a folder")),
        Ok(about) if !about.is_file() => return Ok(()),
        Ok(about) if about.permissions().readonly() => return Err(Error::other("it is read-only")),
        _ => {}
    }
    let missing = |folder: &Path| Error::other(format!("there is no folder {}", folder.display()));
    if !folder_of(path).is_dir() {
        return Err(missing(folder_of(path)));
    }
    let target = destination(path)?;
    let folder = folder_of(&target);
    if folder.is_dir() { unfinished(folder).map(drop) } else { Err(missing(folder)) }
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Writes a file in its folder under another name and renames it, so that another process sees either the old or the
/// new content. If the path is not a regular file (a pipe, `/dev/stdout`), it is written to directly; a symbolic link
/// is followed and kept. Unfinished files of killed processes in the folder are removed.
pub fn replace_with<E: From<Error>>(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> std::result::Result<(), E>,
) -> std::result::Result<(), E> {
    if fs::metadata(path).is_ok_and(|m| !m.is_file()) {
        let mut file = BufWriter::new(File::create(path)?);
        write(&mut file)?;
        return Ok(file.flush()?);
    }
    let target = destination(path)?;
    let folder = folder_of(&target);
    sweep_once(folder);
    let made = unfinished(folder)?;
    // Through the plain file: errors of the temporary one would show its name, which means nothing to the user.
    let mut file = BufWriter::new(made.as_file());
    write(&mut file)?;
    file.flush()?;
    drop(file);
    made.persist(&target).map_err(|e| e.error)?;
    Ok(())
}

/// As [`replace_with`] for bytes; creates the folder if it does not exist.
pub fn replace(path: &Path, bytes: &[u8]) -> Result<()> {
    replace_parts(path, &[bytes])
}

/// As [`replace`] for bytes that lie in several places.
pub fn replace_parts(path: &Path, parts: &[&[u8]]) -> Result<()> {
    fs::create_dir_all(folder_of(path))?;
    replace_with(path, |file| parts.iter().try_for_each(|bytes| file.write_all(bytes)))
}

/// Where a path leads: through links, also to a file that does not exist yet.
fn destination(path: &Path) -> Result<PathBuf> {
    match fs::canonicalize(path) {
        Err(error) if error.kind() == ErrorKind::NotFound => match fs::read_link(path) {
            Ok(link) => destination(&path.parent().unwrap_or(Path::new("")).join(link)),
            Err(_) => Ok(path.to_owned()),
        },
        found => found,
    }
}

/// A new file that its process holds locked for as long as it writes: [`sweep`] knows by the lock which files nobody
/// will finish.
fn unfinished(folder: &Path) -> Result<NamedTempFile> {
    loop {
        let mut builder = tempfile::Builder::new();
        // Like any created file, not private to its owner as temporary files are.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let made = builder.prefix(UNFINISHED).tempfile_in(folder).map_err(|e| {
            let text = e.to_string();
            Error::new(e.kind(), text.split(" at path ").next().unwrap_or(&text).to_owned())
        })?;
        // Where locks are not supported nobody sweeps either.
        if made.as_file().lock().is_err() || made.path().exists() {
            return Ok(made);
        }
        // Another process swept it before it was locked.
    }
}

/// Removes what killed processes left unfinished in a folder. A file that a process still writes is locked and stays.
pub fn sweep(folder: &Path) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        if !entry.file_name().to_string_lossy().starts_with(UNFINISHED) {
            continue;
        }
        if let Ok(file) = File::open(entry.path())
            && file.try_lock().is_ok()
        {
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// Sweeps a folder the first time that this process writes to it.
fn sweep_once(folder: &Path) {
    static SWEPT: Mutex<Option<HashSet<PathBuf>>> = Mutex::new(None);
    let mut swept = SWEPT.lock().unwrap_or_else(PoisonError::into_inner);
    if swept.get_or_insert_default().insert(folder.to_owned()) {
        sweep(folder);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<_> =
            fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn leftovers_of_killed_processes_are_swept_and_files_in_work_stay() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join(".unfinished-killed"), "half").unwrap();
        let working = unfinished(folder.path()).unwrap();
        replace(&folder.path().join("a.txt"), b"whole").unwrap();
        let name = working.path().file_name().unwrap().to_str().unwrap().to_owned();
        assert_eq!(names(folder.path()), [name, "a.txt".into()]);
        working.persist(folder.path().join("b.txt")).unwrap();
        assert_eq!(names(folder.path()), ["a.txt", "b.txt"]);
    }

    #[test]
    #[cfg(unix)]
    fn links_are_followed_and_circles_refused() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        symlink("two", at("one")).unwrap();
        symlink("one", at("two")).unwrap();
        assert!(replace(&at("one"), b"text").is_err());
        assert!(at("one").is_symlink() && at("two").is_symlink());
        symlink("later", at("link")).unwrap();
        replace(&at("link"), b"text").unwrap();
        assert!(at("link").is_symlink());
        assert_eq!(fs::read(at("later")).unwrap(), b"text");
        assert_eq!(names(folder.path()), ["later", "link", "one", "two"]);
    }

    /// The error of a full disk or of a limit on file sizes names only the file that was asked for.
    #[test]
    fn messages_do_not_show_the_unfinished_name() {
        let folder = tempfile::tempdir().unwrap();
        let error = replace(Path::new("/proc/none.txt"), b"text").unwrap_err();
        assert!(!error.to_string().contains(UNFINISHED), "{error}");
        let made = replace_with(&folder.path().join("a"), |_| Err(Error::other("full")));
        assert_eq!(made.unwrap_err().to_string(), "full");
        assert_eq!(names(folder.path()), [""; 0]);
    }
}
