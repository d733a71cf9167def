//! Runs the overlay of the viewer.

use super::overlay::Paint;
use super::panel;
use super::status::Status;
use super::task::BackgroundTask;
use super::viewer::Viewer;
use crate::error::Result;
use crate::frame::Frame;
use std::time::Instant;

impl Viewer {
    /// Runs the overlay on egui's input and executes the commands of its widgets.
    pub fn ui(&mut self, input: egui::RawInput) -> Result<egui::PlatformOutput> {
        let lines = self.outline();
        let status = self.status();
        let context = self.egui.clone();
        let mut commands = Vec::new();
        let output = context.run_ui(input, |ui| {
            panel::outline(ui.ctx(), &lines);
            commands.extend(panel::show(ui.ctx(), &self.editor, &status));
        });
        drop(status);
        let delay = output.viewport_output.values().map(|v| v.repaint_delay).min();
        self.repaint_at = delay.and_then(|delay| Instant::now().checked_add(delay));
        self.paint = Paint {
            primitives: context.tessellate(output.shapes, output.pixels_per_point),
            pixels_per_point: output.pixels_per_point,
        };
        self.overlay.update(output.textures_delta)?;
        for command in commands {
            self.apply(command)?;
        }
        Ok(output.platform_output)
    }

    fn status(&self) -> Status<'_> {
        let info = &self.setup.device.info;
        Status {
            device: &info.name,
            driver: &info.driver,
            size: self.size,
            refined: self.setup.refines.then(|| self.is_refined()),
            timings: &self.timings,
            merged: self.frame.as_ref().map(|f| (f.merged().merged_clusters, f.merged().clusters)),
            vertices: self.frame.as_ref().map_or(0, Frame::receiver_vertex_count),
            lights: self.setup.frame.lights,
            variant: self.frame.as_ref().map(|frame| frame.variant().name),
            bake: self.bake.as_ref().map(BackgroundTask::progress),
            rays: self.rays.as_ref().filter(|rays| rays.is_running()).map(BackgroundTask::progress),
            reference: self.reference.as_ref().map(|r| (r.rays, r.error, r.version == self.version)),
            error: self.error_shown.as_ref().map(|(version, _, scale)| (*scale, *version == self.version)),
            shader_error: self.shader_error.as_deref(),
            messages: self.messages(),
        }
    }
}
