//! A plan: works cut into slices, and everything that decides the bytes of each.

pub use crate::bake::PROGRAM;
use crate::bake::kinds::Kind;
use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Version of the form of a plan.
pub(super) const FORMAT: u32 = 1;
/// Estimated seconds that a slice is made to take: slices of one to five minutes remain so where a machine is half or twice as fast.
pub const SLICE_SECONDS: f64 = 120.0;
/// Most estimated bytes of a slice's result, which its process holds in memory. Pictures may be 2.7 times as large as estimated: that
/// is still below the largest result that is read.
const RESULT_BYTES: f64 = 1e9;
/// What a process takes without any mesh: the program, the driver and its compiled shaders, in MB.
const BASE_MB: u32 = 250;
/// Longest time that a slice is estimated to take: 30 years, beyond which a plan is damaged.
pub(super) const SECONDS_LIMIT: f32 = 1e9;

/// Devices that make the same bytes: of one name and one driver.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DeviceClass {
    /// Name of the device.
    pub name: String,
    /// Name and version of the driver.
    pub driver: String,
}

impl DeviceClass {
    /// That of an open device.
    pub fn of(device: &crate::gpu::Device) -> Self {
        DeviceClass { name: device.info.name.clone(), driver: device.info.driver.clone() }
    }
}

impl std::fmt::Display for DeviceClass {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} ({})", self.name, self.driver)
    }
}

/// What a plan does: the options of `bake` or `render`, as typed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub struct Work {
    /// Words of options.
    pub words: Vec<String>,
    /// Where pictures go, with a run of # for the number; `None` for bakes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pictures: Option<String>,
}

/// A file that tasks read.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Input {
    /// Its path: relative to the plan's folder where it lies below that, else absolute.
    pub path: String,
    /// Hash of its content, and of that of the files that it names.
    pub hash: String,
}

/// What a task makes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TaskKind {
    /// A thing that is baked of a mesh: part `first` of `count`.
    Bake(Kind),
    /// Pictures of a scene: `count` from the number `first` on.
    Frames,
}

/// The least piece of work. In the file it is a row of these five values.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(from = "(u32, u32, TaskKind, u32, u32)", into = "(u32, u32, TaskKind, u32, u32)")]
pub struct Task {
    /// Index of its work.
    pub work: u32,
    /// Index of its input.
    pub input: u32,
    /// What it makes.
    pub kind: TaskKind,
    /// The part of a bake, or the number of the first picture.
    pub first: u32,
    /// Parts of the bake, or pictures.
    pub count: u32,
}

impl From<(u32, u32, TaskKind, u32, u32)> for Task {
    fn from((work, input, kind, first, count): (u32, u32, TaskKind, u32, u32)) -> Self {
        Task { work, input, kind, first, count }
    }
}

impl From<Task> for (u32, u32, TaskKind, u32, u32) {
    fn from(task: Task) -> Self {
        (task.work, task.input, task.kind, task.first, task.count)
    }
}

/// Tasks that run together. In the file it is a row of these five values.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(from = "(u32, u32, f32, u32, u32)", into = "(u32, u32, f32, u32, u32)")]
pub struct Slice {
    /// Index of the first task.
    pub first: u32,
    /// Number of tasks.
    pub count: u32,
    /// Estimated seconds on two cores of a software device.
    pub seconds: f32,
    /// Memory that it needs, in MB.
    pub memory_mb: u32,
    /// Space in the shared folder that its result takes, in KB.
    pub disk_kb: u32,
}

impl From<(u32, u32, f32, u32, u32)> for Slice {
    fn from((first, count, seconds, memory_mb, disk_kb): (u32, u32, f32, u32, u32)) -> Self {
        Slice { first, count, seconds, memory_mb, disk_kb }
    }
}

impl From<Slice> for (u32, u32, f32, u32, u32) {
    fn from(slice: Slice) -> Self {
        (slice.first, slice.count, slice.seconds, slice.memory_mb, slice.disk_kb)
    }
}

/// A plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    pub(super) format: u32,
    /// The program that made it, with its version. Another version refuses it.
    pub program: String,
    /// The devices that may run it.
    pub device: DeviceClass,
    /// Folder of results, relative to the plan's unless it is absolute.
    pub results: String,
    /// Options of what is done.
    pub works: Vec<Work>,
    /// What is read.
    pub inputs: Vec<Input>,
    /// Pieces of work, slice after slice.
    pub tasks: Vec<Task>,
    /// What runs together.
    pub slices: Vec<Slice>,
    /// The plan's own folder.
    #[serde(skip)]
    pub folder: PathBuf,
}

/// What a task is estimated to take.
#[derive(Clone, Copy, Debug)]
pub struct TaskCost {
    /// Seconds on two cores of a software device.
    pub seconds: f64,
    /// Memory besides that of the process itself, in MB.
    pub memory_mb: f64,
    /// Bytes of the result.
    pub bytes: f64,
}

impl Plan {
    /// An empty plan for this program.
    pub fn new(device: DeviceClass, results: String) -> Self {
        Plan {
            format: FORMAT,
            program: PROGRAM.into(),
            device,
            results,
            works: Vec::new(),
            inputs: Vec::new(),
            tasks: Vec::new(),
            slices: Vec::new(),
            folder: PathBuf::new(),
        }
    }

    /// How many tasks like this one a slice may hold, at least one.
    pub fn fitting(cost: TaskCost) -> u32 {
        (SLICE_SECONDS / cost.seconds).min(RESULT_BYTES / cost.bytes).max(1.0) as u32
    }

    /// Adds a task. It joins the last slice while that remains below [`SLICE_SECONDS`] and its result below 1 GB.
    pub fn add(&mut self, task: Task, cost: TaskCost) {
        let memory = BASE_MB + cost.memory_mb.ceil() as u32;
        let kilobytes = (cost.bytes / 1e3).ceil() as u32;
        let fits = |slice: &Slice| {
            let bytes = 1e3 * f64::from(slice.disk_kb) + cost.bytes;
            f64::from(slice.seconds) + cost.seconds <= SLICE_SECONDS && bytes <= RESULT_BYTES
        };
        let begins = !self.slices.last().is_some_and(fits);
        if begins {
            self.slices.push(Slice { first: self.tasks.len() as u32, ..Slice::default() });
        }
        let slice = self.slices.last_mut().expect("one was there or is new");
        slice.count += 1;
        slice.seconds += cost.seconds as f32;
        // Besides what its largest task needs, a process holds the result.
        let largest = slice.memory_mb - slice.disk_kb.div_ceil(1000);
        slice.disk_kb = slice.disk_kb.saturating_add(kilobytes);
        slice.memory_mb = largest.max(memory) + slice.disk_kb.div_ceil(1000);
        self.tasks.push(task);
    }

    /// How many parts a task of so many seconds is cut into.
    pub fn parts(seconds: f64) -> u32 {
        if seconds <= 1.5 * SLICE_SECONDS { 1 } else { (seconds / SLICE_SECONDS).ceil() as u32 }
    }

    /// The tasks of a slice.
    pub fn tasks_of(&self, slice: usize) -> &[Task] {
        let Slice { first, count, .. } = self.slices[slice];
        &self.tasks[first as usize..(first + count) as usize]
    }

    /// The hash of everything that decides the result of a slice, as 32 hexadecimal digits.
    pub fn key(&self, slice: usize) -> String {
        let mut hasher = blake3::Hasher::new();
        let mut add = |text: &str| {
            hasher.update(&(text.len() as u64).to_le_bytes()).update(text.as_bytes());
        };
        [&self.program, &self.device.name, &self.device.driver].into_iter().for_each(|text| add(text));
        for task in self.tasks_of(slice) {
            self.works[task.work as usize].words.iter().for_each(|word| add(word));
            add(&self.inputs[task.input as usize].hash);
            add(&serde_json::to_string(&(task.kind, task.first, task.count)).expect("plain data"));
        }
        hasher.finalize().to_hex()[..32].to_owned()
    }

    /// A path of the plan as a file of this machine.
    pub fn path(&self, text: &str) -> PathBuf {
        self.folder.join(text)
    }

    /// Fails where a device is of another class than the plan's.
    ///
    /// # Errors
    /// `Unsupported` with the names of both.
    pub fn check_device(&self, device: &DeviceClass) -> Result<()> {
        if *device == self.device {
            return Ok(());
        }
        Err(Error::Unsupported(format!("the plan is for {}, and this device is {device}", self.device)))
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A plan of one mesh in so many parts.
    pub fn plan(tasks: u32, seconds: f64) -> Plan {
        let device = DeviceClass { name: "a".into(), driver: "b".into() };
        let mut plan = Plan::new(device, "results".into());
        plan.works.push(Work { words: vec!["--quality".into(), "draft".into()], pictures: None });
        plan.inputs.push(Input { path: "m.obj".into(), hash: "00".into() });
        for index in 0..tasks {
            let cost = TaskCost { seconds, memory_mb: 1.0, bytes: 1e6 };
            plan.add(Task { work: 0, input: 0, kind: TaskKind::Bake(Kind::Shadow), first: index, count: tasks }, cost);
        }
        plan
    }

    #[test]
    fn small_tasks_share_slices_and_a_plan_is_read_as_it_was_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("p.json");
        let mut plan = plan(10, 50.0);
        assert_eq!(plan.slices.len(), 5);
        assert!(plan.slices.iter().all(|slice| slice.seconds == 100.0 && slice.disk_kb == 2000));
        plan.write(&path).unwrap();
        let written = std::fs::read_to_string(&path).unwrap();
        assert!(written.contains(r#""tasks":[[0,0,{"bake":"shadow"},0,10],"#), "{written}");
        assert!(written.contains(r#""slices":[[0,2,100.0,253,2000],"#), "{written}");
        plan.folder = folder.path().to_owned();
        assert_eq!(Plan::read(&path).unwrap(), plan);
        assert_eq!((Plan::parts(150.0), Plan::parts(181.0), Plan::parts(1200.0)), (1, 2, 10));
    }

    /// A process holds the result of its slice: that is stated, and stays below what is read again.
    #[test]
    fn slices_are_short_of_time_and_of_bytes() {
        let mut plan = plan(1, 1.0);
        assert_eq!((plan.slices[0].memory_mb, plan.slices[0].disk_kb), (BASE_MB + 1 + 1, 1000));
        let large = TaskCost { seconds: 1.0, memory_mb: 5.0, bytes: 4e8 };
        (0..3).for_each(|_| plan.add(plan.tasks[0], large));
        let stated: Vec<_> = plan.slices.iter().map(|slice| (slice.count, slice.memory_mb, slice.disk_kb)).collect();
        assert_eq!(stated, [(3, BASE_MB + 5 + 801, 801_000), (1, BASE_MB + 5 + 400, 400_000)]);
        assert_eq!(Plan::fitting(large), 2);
        assert_eq!(Plan::fitting(TaskCost { bytes: 2e9, ..large }), 1);
        assert_eq!(Plan::fitting(TaskCost { bytes: 1.0, ..large }), 120);
    }

    /// Each thing that decides a result is part of its name.
    #[test]
    fn names_of_results_differ_where_anything_differs() {
        let base = plan(2, 100.0);
        let mut keys = vec![base.key(0), base.key(1)];
        let edits: [fn(&mut Plan); 5] = [
            |p| p.program.push('x'),
            |p| p.device.driver.push('x'),
            |p| p.works[0].words[1].push('x'),
            |p| p.inputs[0].hash.push('x'),
            |p| p.tasks[0].kind = TaskKind::Bake(Kind::Vertices),
        ];
        for edit in edits {
            let mut other = base.clone();
            edit(&mut other);
            keys.push(other.key(0));
        }
        let distinct: std::collections::HashSet<_> = keys.iter().collect();
        assert_eq!(distinct.len(), keys.len());
        let mut moved = base.clone();
        moved.inputs[0].path = "elsewhere/m.obj".into();
        assert_eq!(moved.key(0), base.key(0), "where an input lies decides nothing");
    }
}
