//! A worker process: captures what a bake in another process sends it, until that closes the pipe or ends.

use super::batches::{Batches, CaptureTarget, Captures, Reduction};
use super::partial::Partial;
use super::wire::{Answer, Identity, Request, receive, send};
use super::{BakeReport, Baker};
use crate::error::{Error, Result};
use crate::gpu::signals;
use crate::gpu::validation::Messages;
use std::io::{Read, Write};
use std::sync::mpsc;

/// Serves a bake. `open` opens the device, `input` and `output` are the pipes of the bake. Where `input` ends, the process ends at
/// once, in the midst of a sample too: nobody is there who would take it.
///
/// # Errors
/// `Failed` where `output` cannot be written. What goes wrong with a request is answered, and is no error here.
pub fn serve(
    open: impl FnOnce() -> Result<Baker>,
    mut input: impl Read + Send + 'static,
    mut output: impl Write,
) -> Result<()> {
    let (to, requests) = mpsc::channel::<(Request, Vec<u8>)>();
    std::thread::spawn(move || {
        while let Ok(request) = receive(&mut input) {
            if to.send(request).is_err() {
                break;
            }
        }
        signals::end_at_once();
    });
    let failed = |error: Error| Answer::Failed { code: error.exit_code(), message: error.to_string() };
    let mut say = |answer: Answer, bytes: &[u8]| {
        send(&mut output, &answer, &[bytes])
            .map_err(|error| Error::Failed(format!("cannot write to the bake that started this worker: {error}")))
    };
    let baker = match open() {
        Ok(baker) => baker,
        Err(error) => return say(failed(error), &[]),
    };
    say(Answer::Hello(Identity::own(baker.device())), &[])?;
    let mut current = None;
    for (request, bytes) in requests {
        match answer(&baker, &mut current, request, &bytes) {
            Ok((answer, samples)) => say(answer, &samples)?,
            Err(error) => say(failed(error), &[])?,
        }
    }
    Ok(())
}

/// What a request is answered with. `current` is what [`Request::Begin`] has made.
fn answer(
    baker: &Baker,
    current: &mut Option<(Batches, Reduction)>,
    request: Request,
    bytes: &[u8],
) -> Result<(Answer, Vec<u8>)> {
    match request {
        Request::Begin { mesh, reduction, face_px, shortcuts, levels } => {
            // What the last mesh took is free before the next takes more.
            *current = None;
            let (mesh, partial) = (mesh.mesh(bytes)?, Partial::new(None));
            let captures = Captures { mesh: &mesh, reduction, face_px, shortcuts, levels, partial: &partial };
            *current = Some((Batches::new(baker, &captures)?, reduction));
            Ok((Answer::Ready, Vec::new()))
        }
        Request::Capture => {
            let (batches, reduction) =
                current.as_mut().ok_or_else(|| Error::Failed("targets without a mesh".into()))?;
            let targets: Vec<CaptureTarget> = bytemuck::pod_collect_to_vec(bytes);
            if targets.len() as u32 > batches.capacity() || bytes.len() % size_of::<CaptureTarget>() != 0 {
                return Err(Error::Failed(format!("{} bytes of targets are more than a batch", bytes.len())));
            }
            let mut report = BakeReport::default();
            let samples = batches.run_unit(&targets, &mut report)?;
            Messages::into_result(baker.device().take_validation_messages())?;
            debug_assert_eq!(samples.len(), targets.len() * reduction.sample_bytes());
            let BakeReport { capture_ms, project_ms, faces, triangles, .. } = report;
            Ok((Answer::Samples { capture_ms, project_ms, faces, triangles }, samples))
        }
    }
}
