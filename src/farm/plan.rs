//! A plan: meshes to bake and films to render, cut into slices, with everything that decides the bytes of each.

use crate::asset;
use crate::bake;
pub use crate::bake::PROGRAM;
use crate::error::{Error, Result, one_line};
use crate::frame;
use crate::gpu::Device;
use crate::text;
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Longest plan that is read.
const LIMIT_BYTES: u64 = 1 << 30;

/// A file that slices read.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Input {
    /// Relative to the plan's folder if it lies below that, else absolute.
    pub path: String,
    /// Hash of its content, and of that of the files that it names.
    pub hash: String,
}

/// A scene of which pictures are rendered.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Film {
    pub scene: Input,
    /// Where pictures go, with a run of # for the number; relative to the plan's folder.
    pub pictures: String,
    pub options: frame::Options,
    /// The scene's exposure in stops, or what the light of picture 0 gives where it states none.
    #[serde(default)]
    pub exposure_ev: f32,
    /// Scene time of picture 0, in seconds.
    pub first_s: f64,
    /// Pictures per second of scene time.
    pub fps: u16,
}

/// Work of one process.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Slice {
    /// Everything that is baked of these meshes of the plan.
    Meshes { first: u32, count: u32 },
    /// Pictures of a film of the plan, by their numbers.
    Pictures { film: u32, first: u32, count: u32 },
}

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// The program that made it, with its version. Another version refuses it. Plans of all versions have this key.
    pub plan_of: String,
    /// The devices that may run it, see [`device_class`].
    pub device: String,
    /// Folder of results, relative to the plan's unless it is absolute.
    pub results: String,
    /// How meshes are baked.
    pub bake: bake::Options,
    pub meshes: Vec<Input>,
    pub films: Vec<Film>,
    pub slices: Vec<Slice>,
    #[serde(skip)]
    pub folder: PathBuf,
}

/// Name and driver of a device: those that agree in both make the same bytes.
pub fn device_class(device: &Device) -> String {
    format!("{} ({})", device.info.name, device.info.driver)
}

/// A path as plans and the scripts of engines have it. A control character would end a line of a script.
pub fn plain(path: &Path) -> Result<&str> {
    path.to_str().filter(|text| !text.contains(char::is_control)).ok_or_else(|| {
        let what = "a farm takes no control characters in paths, and only UTF-8";
        Error::Usage(format!("{}: {what}", path.display()))
    })
}

/// The program that made a plan; `None` where these are not the bytes of one.
fn maker(bytes: &[u8]) -> Option<String> {
    #[derive(Deserialize)]
    struct Made {
        plan_of: String,
    }
    serde_json::from_slice(bytes).ok().map(|made: Made| made.plan_of)
}

/// First and count of runs of `most` and a rest.
fn runs(all: u32, most: u32) -> impl Iterator<Item = (u32, u32)> {
    (0..all).step_by(most as usize).map(move |first| (first, most.min(all - first)))
}

impl Plan {
    /// An empty plan for this program.
    pub fn new(device: String, results: String, bake: bake::Options) -> Self {
        Plan { plan_of: PROGRAM.into(), device, results, bake, ..Plan::default() }
    }

    /// Adds meshes, of which a slice bakes `most`.
    pub fn add_meshes(&mut self, meshes: Vec<Input>, most: u32) {
        self.slices.extend(runs(meshes.len() as u32, most).map(|(first, count)| Slice::Meshes { first, count }));
        self.meshes = meshes;
    }

    /// Adds the pictures 0 to `frames` - 1 of a film, of which a slice renders `most`.
    pub fn add_film(&mut self, film: Film, frames: u32, most: u32) {
        let index = self.films.len() as u32;
        self.slices.extend(runs(frames, most).map(|(first, count)| Slice::Pictures { film: index, first, count }));
        self.films.push(film);
    }

    /// The meshes `first` to `first + count - 1`.
    pub fn meshes(&self, first: u32, count: u32) -> &[Input] {
        &self.meshes[first as usize..][..count as usize]
    }

    /// The hash of everything that decides the result of a slice, as 32 hexadecimal digits.
    pub fn key(&self, slice: usize) -> String {
        let work = match self.slices[slice] {
            Slice::Meshes { first, count } => {
                let hashes: Vec<&str> = self.meshes(first, count).iter().map(|mesh| mesh.hash.as_str()).collect();
                json!(["bake", self.bake, hashes])
            }
            Slice::Pictures { film, first, count } => {
                let film = &self.films[film as usize];
                json!(["render", film.scene.hash, film.options, film.exposure_ev, film.first_s, film.fps, first, count])
            }
        };
        let all = json!([self.plan_of, self.device, work]).to_string();
        blake3::hash(all.as_bytes()).to_hex()[..32].to_owned()
    }

    /// A path of the plan as a file of this machine.
    pub fn path(&self, text: &str) -> PathBuf {
        self.folder.join(text)
    }

    /// Fails with both names where a device is of another class than the plan's.
    pub fn check_device(&self, device: &Device) -> Result<()> {
        let found = device_class(device);
        if found == self.device {
            return Ok(());
        }
        Err(Error::Unsupported(format!("the plan is for {}, and this device is {found}", self.device)))
    }

    /// Whether a file holds a plan, of this version or another.
    pub fn is_at(path: &Path) -> bool {
        asset::read_file(path, LIMIT_BYTES).is_ok_and(|bytes| maker(&bytes).is_some())
    }

    /// Writes the plan, whole or not at all.
    pub fn write(&self, path: &Path) -> Result<()> {
        text::write(path, serde_json::to_vec(self).expect("a plan is plain data"))
    }

    /// Reads a plan and checks that this program made it.
    pub fn read(path: &Path) -> Result<Self> {
        Self::parse(&asset::read_file(path, LIMIT_BYTES)?, path)
    }

    /// As [`Plan::read`], of the bytes of the file `path`.
    pub fn parse(bytes: &[u8], path: &Path) -> Result<Self> {
        let bad = |what: &str| Error::input(path, one_line(what));
        // The version comes first: another program's plan may have another form.
        let made_by = maker(bytes).ok_or_else(|| bad("not a plan"))?;
        if made_by != PROGRAM {
            return Err(Error::Unsupported(format!(
                "{}: a plan of {}, and this is {PROGRAM}; plan again, or use that program",
                path.display(),
                one_line(&made_by)
            )));
        }
        let mut plan: Plan = serde_json::from_slice(bytes).map_err(|error| bad(&format!("not a plan: {error}")))?;
        plan.check().map_err(|what| bad(&what))?;
        let full = std::path::absolute(path).map_err(|error| bad(&format!("cannot be read: {error}")))?;
        plan.folder = full.parent().unwrap_or(Path::new("/")).to_owned();
        Ok(plan)
    }

    /// Whether all indices lead somewhere, all numbers make sense, and no path breaks a line.
    fn check(&self) -> std::result::Result<(), String> {
        if self.slices.is_empty() {
            return Err("it has no slices".into());
        }
        for (index, slice) in self.slices.iter().enumerate() {
            let (film, first, count, all) = match *slice {
                Slice::Meshes { first, count } => (None, first, count, self.meshes.len()),
                Slice::Pictures { film, first, count } => (Some(film as usize), first, count, u32::MAX as usize),
            };
            let has_film = film.is_none_or(|film| film < self.films.len());
            if !has_film || count == 0 || first as usize + count as usize > all {
                return Err(format!("slice {index} is of things that are not there"));
            }
        }
        let of_films = self.films.iter().flat_map(|film| [&film.scene.path, &film.pictures]);
        for path in self.meshes.iter().map(|mesh| &mesh.path).chain(of_films).chain([&self.results]) {
            plain(Path::new(path)).map_err(|error| error.to_string())?;
        }
        match self.films.iter().find(|film| film.fps == 0 || !film.first_s.is_finite()) {
            Some(film) => Err(format!("the film of {} has no time", film.scene.path)),
            None => Ok(()),
        }
    }
}
