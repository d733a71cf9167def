//! One frame from top to bottom: every pass in its order, with every barrier between passes.
//!
//! Files, benches and the window record their frames by this one function. They differ in the target of the picture,
//! and in who waits: a file submits the recording and waits for its end, the window launches it and goes on to the next
//! frame.

use crate::bounce::{Bounce, BounceWork};
use crate::draw::smooth::Lines;
use crate::draw::{Draw, DrawnViewport};
use crate::error::Result;
use crate::gloss::{ReflectionInputs, Reflections};
use crate::gpu::{self, Access, Buffer, Commands, Drawing, Image};
use crate::merge::{Merge, MergeInputs};
use crate::sharp::{self, Sharp};
use glam::Vec3;

/// The clusters to light, and all that lights them.
pub struct MergeWork<'f> {
    pub(super) cluster_count: u32,
    pub(super) inputs: MergeInputs<'f>,
    pub(super) merge: &'f Merge,
    /// The pass of sharp lights with what it reads; `None` where the scene has none.
    pub(super) sharp: Option<(&'f Sharp, sharp::SharpInputs<'f>)>,
    /// Output of the merge: all light, or the part to which the pass of sharp lights adds.
    pub(super) soft: &'f Buffer,
    pub(super) radiosity: &'f Buffer,
    /// What adds bounces to the direct light of all vertices.
    pub(super) bounce: Option<(&'f Bounce, BounceWork<'f>)>,
}

pub struct PictureWork<'f> {
    pub(super) draw: &'f Draw,
    pub(super) viewports: Vec<DrawnViewport<'f>>,
    /// What each mirror shows.
    pub(super) mirrored: Vec<DrawnViewport<'f>>,
    pub(super) background: Vec3,
    pub(super) white: f32,
    pub(super) lines: &'f Lines,
    /// What glossy surfaces reflect towards the eye.
    pub(super) gloss: Option<(&'f Reflections, ReflectionInputs<'f>)>,
}

/// Where the picture goes once it is drawn.
pub enum PictureTarget<'t, 'f> {
    /// It stays on the device, where a fragment shader may read it.
    Device,
    /// Into a buffer that the host reads.
    Host { picture: &'f Image, readback: &'f Buffer },
    /// Onto an image of a window, or onto one that stands for it.
    Screen {
        /// Its content is thrown away first.
        image: &'f Image,
        /// Linear RGBA where nothing is shown.
        clear: [f32; 4],
        /// Draws the picture that was made last, and what lies over it.
        show: &'t mut dyn FnMut(&mut Drawing<'_, 'f>) -> Result<()>,
        /// The image's next use.
        next: Access,
    },
}

/// Records one frame: lights `merge`'s clusters, draws `picture`, and brings it to the target. Where one of them is
/// `None`, light or picture stay as the last frame left them.
///
/// On a software device every pass begins and ends with a full barrier besides the ones below, see
/// [`Commands::separates_passes`]: timestamps need it there. No pass may rely on it, and the tracker does not count it.
pub fn record<'f>(
    commands: &mut Commands<'f>,
    merge: Option<&MergeWork<'f>>,
    picture: Option<&PictureWork<'f>>,
    target: PictureTarget<'_, 'f>,
) -> Result<()> {
    if matches!(target, PictureTarget::Screen { .. }) || merge.is_none() || commands.is_shared() {
        // The frame before may be under way, and uses the same buffers and images; a picture alone shows its light. A
        // caller that shares the device may still read that light.
        commands.after_flights();
    }
    if let Some(work) = merge {
        commands.pass("merge", |c| work.merge.record(c, &work.inputs, work.soft, work.cluster_count))?;
        if let Some((sharp, inputs)) = &work.sharp {
            // The pass reads what the merge has written.
            commands.computed();
            commands.pass("sharp", |c| sharp.record(c, inputs, work.radiosity, work.cluster_count))?;
        }
        if let Some((bounce, bounce_work)) = &work.bounce {
            // Direct light of every cluster, of this frame or an earlier one.
            commands.computed();
            commands.pass("bounce", |c| bounce.record(c, bounce_work))?;
        }
    }
    if merge.is_some() && commands.is_shared() {
        commands.barrier(Access::ComputeWrite, Access::Caller);
    }
    let gloss = picture.and_then(|picture| picture.gloss.as_ref());
    if let Some((reflections, inputs)) = gloss {
        commands.computed();
        commands.pass("gloss", |c| reflections.record(c, inputs))?;
    }
    if let Some(picture) = picture.filter(|_| merge.is_some() || gloss.is_some()) {
        // Triangles read the radiosity as a vertex attribute, grids look it up in the fragment shader, and what evaluates
        // pixels does in a compute shader.
        commands.barrier(Access::ComputeWrite, Access::VertexRead);
        commands.barrier(Access::ComputeWrite, Access::GraphicsSampled);
        if picture.viewports.iter().chain(&picture.mirrored).any(|viewport| viewport.pixel.is_some()) {
            commands.barrier(Access::ComputeWrite, Access::ComputeSampled);
        }
    }
    if let Some(PictureWork { draw, viewports, mirrored, background, white, lines, .. }) = picture {
        if let Some(mirrors) = &draw.mirrors {
            commands.pass("mirror", |c| mirrors.record(c, mirrored))?;
        }
        for (image, access) in draw.attachments() {
            commands.image_barrier(image, None, access);
        }
        if let Some(light) = draw.pixel_light(viewports) {
            let counts = matches!(target, PictureTarget::Host { .. });
            commands.pass("pixel light", |c| {
                light.record(c, viewports)?;
                if counts { light.count(c) } else { Ok(()) }
            })?;
        }
        commands.pass("draw", |c| draw.record(c, viewports, background.extend(1.0), *white))?;
        if let Some(smooth) = &draw.smooth {
            // The pass copies the picture, and then reads picture and depth while it changes the copy.
            commands.barrier(Access::ColorWrite, Access::GraphicsSampled);
            commands.image_barrier(&draw.picture, Some(Access::ColorWrite), Access::TransferRead);
            commands.image_barrier(&draw.depth, Some(Access::DepthWrite), Access::GraphicsSampled);
            commands.image_barrier(&smooth.picture, None, Access::TransferWrite);
            commands.pass("smooth", |c| smooth.record(c, (&draw.picture, &draw.depth), lines, viewports))?;
        }
        let reader =
            if matches!(target, PictureTarget::Host { .. }) { Access::TransferRead } else { Access::GraphicsSampled };
        commands.image_barrier(draw.finished(), Some(Access::ColorWrite), reader);
    }
    match target {
        PictureTarget::Device => {}
        PictureTarget::Host { picture, readback } => {
            commands.pass("read back", |c| {
                c.copy_image(picture, readback);
                Ok(())
            })?;
            commands.barrier(Access::TransferWrite, Access::HostRead);
        }
        PictureTarget::Screen { image, clear, show, next } => {
            commands.image_barrier(image, None, Access::ColorWrite);
            let color = gpu::Target { color: image, second: None, clear: Some(clear), depth: None, resolve: None };
            commands.pass("show", |c| c.render(&color, show))?;
            commands.image_barrier(image, Some(Access::ColorWrite), next);
        }
    }
    Ok(())
}
