//! Shares the captures of a bake out among worker processes, each with a device of its own.
//!
//! llvmpipe transforms and clips triangles on one thread for each device, so drawn faces leave cores idle: those of
//! radiance fields and of captures too large for [`super::raster`]. Computed faces keep all cores busy, and workers
//! would only repeat the host's share. Two devices in one process crash llvmpipe, so each worker is a process. The
//! bake's own process captures too. Units are dealt out one at a time, so that nobody waits long for another.

use super::BakeReport;
use super::batches::{CaptureTarget, Captures, Unit};
use super::wire::{Answer, Identity, MeshShape, Request, receive, send};
use crate::error::{Error, Result};
use crate::gpu::{self, Device, Validation};
use crate::shaders::Library;
use std::path::PathBuf;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError, mpsc};

/// Estimated seconds from which on workers are started where their number is left to the program. A worker opens its device in about
/// 0.5 s, which has to be won first.
const WORTHWHILE_SECONDS: f64 = 2.0;
/// The hidden subcommand that a worker is.
pub const COMMAND: &str = "bake-worker";

/// How worker processes are started.
#[derive(Clone, Debug)]
pub struct WorkerOptions {
    /// The program, which understands the subcommand [`COMMAND`]: that of this package and of this version.
    pub program: PathBuf,
    /// Processes that capture, this one included, however small a mesh is. `None` leaves it to the device and the mesh: one a core
    /// where a software device draws faces for an estimated two seconds or more, else this process alone.
    pub jobs: Option<u32>,
    /// Which validation checks run in workers.
    pub validation: Validation,
}

/// Worker processes of a [`super::Baker`]. They are started when a bake first needs them, and ended with the last clone of it.
pub struct Workers {
    options: WorkerOptions,
    device: Arc<Device>,
    library: Library,
    idle: Mutex<Vec<Worker>>,
}

/// What is shared out: the units of `left`.
pub(super) struct Work<'w> {
    pub setup: &'w Captures<'w>,
    pub targets: &'w [CaptureTarget],
    pub units: &'w [Unit],
    pub left: &'w [usize],
    /// Estimated seconds of what is left.
    pub seconds: f64,
    /// Whether faces are computed rather than drawn.
    pub computes: bool,
}

/// Captures by this process itself.
pub(super) type Own<'o> = &'o mut dyn FnMut(&Unit, &mut BakeReport) -> Result<Vec<u8>>;

/// Deals out what is left of `work` to this process, which captures by `own`, and to workers. Every unit's samples come to `put` in
/// this thread.
///
/// # Errors
/// What `own` returns; what a worker says or how it ended, when its second try failed too.
pub(super) fn share(
    workers: Option<&Arc<Workers>>,
    work: &Work<'_>,
    own: Own<'_>,
    report: &mut BakeReport,
    put: &mut dyn FnMut(usize, &[u8]),
) -> Result<()> {
    let deal = Deal { next: AtomicUsize::new(0), left: work.left };
    std::thread::scope(|scope| {
        // Ends the deal when this function returns or unwinds, since the scope waits for its threads.
        let _end = Ended(&deal);
        let (to, results) = mpsc::channel();
        if let Some(workers) = workers {
            // This process is the first.
            for number in 2..2 + workers.helpers(work) {
                let (to, deal) = (to.clone(), &deal);
                scope.spawn(move || workers.help(number, work, deal, &to));
            }
        }
        drop(to);
        let mut take = |(unit, outcome): (usize, Result<Captured>), report: &mut BakeReport| {
            let captured: Captured = outcome?;
            report.capture_ms += captured.report.capture_ms;
            report.project_ms += captured.report.project_ms;
            report.faces += captured.report.faces;
            report.triangles += captured.report.triangles;
            put(unit, &captured.samples);
            Ok::<(), Error>(())
        };
        while let Some(unit) = deal.next() {
            let samples = own(&work.units[unit], report)?;
            take((unit, Ok(Captured { samples, report: BakeReport::default() })), report)?;
            for found in results.try_iter() {
                take(found, report)?;
            }
        }
        results.iter().try_for_each(|found| take(found, report))
    })
}

/// Units that nobody has taken yet.
struct Deal<'d> {
    next: AtomicUsize,
    left: &'d [usize],
}

impl Deal<'_> {
    fn next(&self) -> Option<usize> {
        // The counter stays far below where it would wrap: whoever finds nothing stops asking.
        self.left.get(self.next.fetch_add(1, Ordering::Relaxed)).copied()
    }
}

struct Ended<'e, 'd>(&'e Deal<'d>);

impl Drop for Ended<'_, '_> {
    fn drop(&mut self) {
        self.0.next.store(self.0.left.len(), Ordering::Relaxed);
    }
}

/// Samples of a unit, and what they took.
struct Captured {
    samples: Vec<u8>,
    report: BakeReport,
}

impl Workers {
    /// Workers for bakes on `device`, with the shaders of `library`. None is started yet.
    pub fn new(options: WorkerOptions, device: &Arc<Device>, library: &Library) -> Arc<Self> {
        Arc::new(Workers { options, device: device.clone(), library: library.clone(), idle: Mutex::default() })
    }

    /// Ends the workers that idle. The next bake starts others.
    pub fn dismiss(&self) {
        self.idle.lock().unwrap_or_else(PoisonError::into_inner).clear();
    }

    /// Most processes that a bake has, this one included, whose faces are computed or drawn.
    pub(super) fn most(&self, computes: bool) -> usize {
        let usual = if self.device.info.is_software() && !computes { gpu::cores() } else { 1 };
        self.options.jobs.map_or(usual, |jobs| jobs as usize)
    }

    /// Workers that serve some work besides this process.
    fn helpers(&self, work: &Work<'_>) -> usize {
        let worthwhile = self.options.jobs.is_some() || work.seconds > WORTHWHILE_SECONDS;
        let jobs = if worthwhile { self.most(work.computes) } else { 1 };
        jobs.min(work.left.len()).saturating_sub(1)
    }

    /// The life of a thread that feeds one worker. A worker that dies is replaced once; the error of the second goes to `to`.
    fn help(&self, number: usize, work: &Work<'_>, deal: &Deal<'_>, to: &mpsc::Sender<(usize, Result<Captured>)>) {
        let begin = || self.take().and_then(|worker| worker.begin(work.setup));
        let again = |error: Error| {
            log::info!("worker process {number}: {error}; starting another");
            begin()
        };
        let mut worker = match begin().or_else(again) {
            Ok(worker) => worker,
            Err(error) => {
                log::warn!("worker process {number}: {error}; baking without it");
                return;
            }
        };
        while let Some(index) = deal.next() {
            let unit = &work.units[index];
            let targets = &work.targets[unit.targets()];
            let bytes = work.setup.reduction.sample_bytes();
            let mut outcome = worker.capture(targets, bytes);
            if let Err(error) = outcome {
                log::info!("worker process {number}: {error}; starting another");
                outcome = begin().and_then(|other| {
                    worker = other;
                    worker.capture(targets, bytes)
                });
            }
            let outcome = outcome.map_err(|error| {
                let (name, samples) = (&work.setup.mesh.name, unit.targets());
                let place = format!("samples {} to {} of {name}", samples.start + 1, samples.end);
                error.context(format!("worker process {number}, at its second try of {place}"))
            });
            let ended = outcome.is_err();
            if to.send((index, outcome)).is_err() || ended {
                return;
            }
        }
        self.idle.lock().unwrap_or_else(PoisonError::into_inner).push(worker);
    }

    /// A worker that idles, or a new one.
    fn take(&self) -> Result<Worker> {
        let idle = self.idle.lock().unwrap_or_else(PoisonError::into_inner).pop();
        idle.map_or_else(|| self.start(), Ok)
    }

    fn start(&self) -> Result<Worker> {
        let mut command = Command::new(&self.options.program);
        command.arg(COMMAND).args(["--device", &self.device.info.uuid, "--validation"]);
        command.arg(format!("{:?}", self.options.validation).to_lowercase());
        if let Some(folder) = &self.library.shader_dir {
            command.arg("--shader-dir").arg(folder);
        }
        match &self.library.cache_dir {
            Some(folder) => command.arg("--cache-dir").arg(folder),
            None => command.arg("--no-cache"),
        };
        gpu::share_cores(&mut command, self.most(false));
        // Ctrl-C in a terminal reaches this process alone, whose end closes the pipes.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let cannot = |error| Error::Failed(format!("{}: cannot be started: {error}", self.options.program.display()));
        let mut process = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().map_err(cannot)?;
        let pipes = (process.stdin.take().expect("it is piped"), process.stdout.take().expect("it is piped"));
        let mut worker = Worker { pipes: Some(pipes), process };
        let own = Identity::own(&self.device);
        match worker.answer()? {
            (Answer::Hello(other), _) if other == own => Ok(worker),
            (Answer::Hello(other), _) => Err(Error::Failed(format!("the worker is {other}, and this is {own}"))),
            _ => Err(Error::Failed("the worker did not begin with its identity".into())),
        }
    }
}

/// A worker process. It ends when it is dropped.
struct Worker {
    pipes: Option<(ChildStdin, ChildStdout)>,
    process: Child,
}

impl Drop for Worker {
    fn drop(&mut self) {
        // At the end of its input it ends by itself, wherever it is.
        self.pipes = None;
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

impl Worker {
    fn ask(&mut self, request: &Request, bytes: &[&[u8]]) -> Result<(Answer, Vec<u8>)> {
        let (to, _) = self.pipes.as_mut().expect("open until it is dropped");
        match send(to, request, bytes) {
            Ok(()) => self.answer(),
            Err(error) => Err(self.died(&error)),
        }
    }

    fn answer(&mut self) -> Result<(Answer, Vec<u8>)> {
        let (_, from) = self.pipes.as_mut().expect("open until it is dropped");
        match receive(from) {
            Ok((Answer::Failed { code, message }, _)) => Err(Error::of_code(code, message)),
            Ok(answer) => Ok(answer),
            Err(error) => Err(self.died(&error)),
        }
    }

    /// How it ended, after a pipe said `error`.
    fn died(&mut self, error: &std::io::Error) -> Error {
        let id = self.process.id();
        self.pipes = None;
        let _ = self.process.kill();
        let how = self.process.wait().map_or_else(|_| error.to_string(), |status| status.to_string());
        Error::Failed(format!("process {id} has died ({how})"))
    }

    /// The worker, when it is ready for targets of a mesh.
    fn begin(mut self, setup: &Captures<'_>) -> Result<Self> {
        let Captures { mesh, reduction, face_px, shortcuts, levels, .. } = *setup;
        let request = Request::Begin { mesh: MeshShape::of(mesh), reduction, face_px, shortcuts, levels };
        match self.ask(&request, &MeshShape::arrays(mesh))? {
            (Answer::Ready, _) => Ok(self),
            _ => Err(Error::Failed("the worker did not answer that it is ready".into())),
        }
    }

    /// Reduced samples of planned targets, each of `sample_bytes`.
    fn capture(&mut self, targets: &[CaptureTarget], sample_bytes: usize) -> Result<Captured> {
        match self.ask(&Request::Capture, &[bytemuck::cast_slice(targets)])? {
            (Answer::Samples { capture_ms, project_ms, faces, triangles }, samples)
                if samples.len() == targets.len() * sample_bytes =>
            {
                let report = BakeReport { capture_ms, project_ms, faces, triangles, ..Default::default() };
                Ok(Captured { samples, report })
            }
            _ => Err(Error::Failed("the worker did not answer with the samples that it was asked for".into())),
        }
    }
}
