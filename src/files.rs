//! Files that are never seen half-written.

use std::fs;
use std::io::{BufWriter, Result, Write};
use std::path::Path;

/// Writes a file in its folder under another name and renames it, so that another process sees the old one or the new one,
/// never a part. What is not a regular file (a pipe, `/dev/stdout`) is written to as it stands; a link keeps pointing where it
/// did.
///
/// # Errors
/// What `write` or the file system returns; nothing is left behind then.
pub fn replace_with<E: From<std::io::Error>>(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> std::result::Result<(), E>,
) -> std::result::Result<(), E> {
    if fs::metadata(path).is_ok_and(|m| !m.is_file()) {
        let mut file = BufWriter::new(fs::File::create(path)?);
        write(&mut file)?;
        return Ok(file.flush()?);
    }
    let target = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    let folder = target.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    // Like any created file, not private to its owner as temporary files are.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    // The error names the other name, which is nobody's business.
    let made = builder.prefix(".unfinished-").tempfile_in(folder).map_err(|e| {
        let text = e.to_string();
        std::io::Error::new(e.kind(), text.split(" at path ").next().unwrap_or(&text).to_owned())
    });
    let mut file = BufWriter::new(made?);
    write(&mut file)?;
    file.flush()?;
    file.into_inner().map_err(|e| e.into_error())?.persist(&target).map_err(|e| e.error)?;
    Ok(())
}

/// As [`replace_with`] for bytes; the folder is made if it is not there.
///
/// # Errors
/// What the file system returns.
pub fn replace(path: &Path, bytes: &[u8]) -> Result<()> {
    if let Some(folder) = path.parent().filter(|p| !p.as_os_str().is_empty()) {
        fs::create_dir_all(folder)?;
    }
    replace_with(path, |file| file.write_all(bytes))
}
