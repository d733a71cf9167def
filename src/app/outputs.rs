//! The files that a command writes, compared with those that it reads before anything runs.

use crate::error::{Error, Result};
use crate::files::{self, Identity};
use std::collections::{HashMap, HashSet};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// The files of one option.
pub struct Output {
    option: &'static str,
    ending: &'static str,
    files: Vec<PathBuf>,
}

impl Output {
    /// A file whose name has to end as its kind does.
    pub fn new(option: &'static str, file: impl Into<PathBuf>, ending: &'static str) -> Self {
        Output { option, ending, files: vec![file.into()] }
    }

    /// Pictures of these numbers where the name has a run of `#`, else one picture.
    pub fn pictures(option: &'static str, file: &Path, ending: &'static str, numbers: Range<u32>) -> Result<Self> {
        let name = PictureName::new(file)?;
        let numbers = if name.is_numbered() { numbers } else { 0..1 };
        Ok(Output { option, ending, files: numbers.map(|number| name.path(number)).collect() })
    }

    /// Those of its files that are there; `None` where none is.
    pub fn existing(mut self) -> Option<Self> {
        self.files.retain(|file| file.exists());
        (!self.files.is_empty()).then_some(self)
    }
}

/// Fails where a name has another ending than its kind, where a file would replace one that is read or that another
/// option writes, also through links, and where one cannot be written.
pub fn check(inputs: &[PathBuf], outputs: &[Output]) -> Result<()> {
    let read: HashMap<Identity, &PathBuf> =
        inputs.iter().filter_map(|path| Some((files::identity(path)?, path))).collect();
    let mut taken: HashMap<Identity, (&str, &Path)> = HashMap::new();
    for Output { option, ending, files } in outputs {
        check_ending(option, &files[0], ending)?;
        for file in files {
            let Some(identity) = files::identity(file) else { continue };
            let shown = file.display();
            if let Some(input) = read.get(&identity) {
                let what = format!("{option} {shown} would replace the input {}", input.display());
                return Err(Error::Usage(what));
            }
            if let Some((other, first)) = taken.insert(identity, (option, file)) {
                let what = format!("{option} {shown} would replace what {other} {} writes", first.display());
                return Err(Error::Usage(what));
            }
        }
    }
    for Output { files, .. } in outputs {
        // The others of a run stand in the same folder.
        for (_, file) in files.iter().enumerate().filter(|(index, file)| *index == 0 || file.exists()) {
            let cannot = |error| Error::Failed(format!("{}: cannot be written: {error}", file.display()));
            files::check_writable(file).map_err(cannot)?;
        }
    }
    Ok(())
}

/// Makes the folder that results of several names go to. Fails where it holds an input, which one of them might
/// replace, and where nothing can be written into it.
pub fn check_folder(option: &str, folder: &Path, inputs: &[PathBuf]) -> Result<()> {
    let cannot = |error| Error::Failed(format!("{}: cannot be written: {error}", folder.display()));
    let is_there = |folder: &&Path| folder.as_os_str().is_empty() || folder.exists();
    let base = folder.ancestors().find(is_there).unwrap_or(Path::new("."));
    if base != folder {
        return files::check_writable(&base.join("results")).map_err(cannot);
    }
    let entries = std::fs::read_dir(folder).map_err(cannot)?.flatten();
    let there: HashSet<Identity> = entries.filter_map(|entry| files::identity(&entry.path())).collect();
    if let Some(input) = inputs.iter().find(|input| files::identity(input).is_some_and(|it| there.contains(&it))) {
        let folder = folder.display();
        let input = input.display();
        return Err(Error::Usage(format!(
            "{option} {folder}: results might replace the input {input}, which is there"
        )));
    }
    files::check_writable(&folder.join("results")).map_err(cannot)
}

/// Fails where a file's name does not end as its kind does; a device or pipe may have any name.
pub fn check_ending(option: &str, path: &Path, ending: &str) -> Result<()> {
    let device = std::fs::metadata(path).is_ok_and(|m| !m.is_file());
    if device || path.extension().is_some_and(|e| e.eq_ignore_ascii_case(ending)) {
        return Ok(());
    }
    Err(Error::Usage(format!("{option} {}: the name must end in .{ending}", path.display())))
}

/// A name that pictures are written to.
pub enum PictureName {
    One(PathBuf),
    /// One with a run of `#` that stands for the picture's number.
    Numbered {
        before: String,
        digits: usize,
        after: String,
    },
}

impl PictureName {
    pub fn new(name: &Path) -> Result<Self> {
        if !name.as_os_str().as_encoded_bytes().contains(&b'#') {
            return Ok(PictureName::One(name.into()));
        }
        let Some(text) = name.to_str() else {
            return Err(Error::Usage(format!("{}: a name with # has to be UTF-8", name.display())));
        };
        let (before, rest) = text.split_once('#').expect("one of its bytes");
        let after = rest.trim_start_matches('#');
        Ok(PictureName::Numbered { before: before.into(), digits: 1 + rest.len() - after.len(), after: after.into() })
    }

    pub fn is_numbered(&self) -> bool {
        matches!(self, PictureName::Numbered { .. })
    }

    /// The name of one picture.
    pub fn path(&self, number: u32) -> PathBuf {
        match self {
            PictureName::One(name) => name.clone(),
            PictureName::Numbered { before, digits, after } => {
                format!("{before}{number:0width$}{after}", width = *digits).into()
            }
        }
    }
}
