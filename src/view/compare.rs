//! The viewer's ray-cast reference, which a background task computes, and the error of the merge against it.

use super::command::Changed;
use super::reference;
use super::status::ErrorScale;
use super::task::BackgroundTask;
use super::viewer::{ERROR, REFERENCE, Viewer};
use crate::asset::false_color::NEUTRAL;
use crate::error::Result;
use crate::truth::error_map::{self, ErrorMap};

impl Viewer {
    /// Starts casting rays if they are wanted, receives results, and compares.
    pub(super) fn look_at_rays(&mut self) -> Result<()> {
        let wanted = self.editor.reference || self.editor.error;
        if !wanted || self.frame.is_none() {
            self.rays = None;
            return Ok(());
        }
        if let Some(found) = self.rays.as_ref().and_then(|rays| rays.results().pop()) {
            let frame = self.frame.as_mut().expect("checked above");
            frame.set_comparison(REFERENCE, &found.radiosity, [0.0; 3])?;
            self.reference = Some(found);
            self.pending |= Changed { display: true, ..Changed::default() };
        }
        if let Some(Err(error)) = self.rays.as_mut().and_then(BackgroundTask::ended) {
            self.tolerate(Err::<(), _>(error)).map(|_| ())?;
        }
        let current = self.reference.as_ref().is_some_and(|r| r.version == self.version);
        // Rays for an outdated state end after their first round, so that a coarse reference is visible while entities
        // move.
        let known = self.reference.as_ref().map(|r| r.version);
        let stale = self.rays_version != self.version && known == Some(self.rays_version);
        if (self.rays.is_none() && !current)
            || stale
            || (!current && !self.rays.as_ref().is_some_and(BackgroundTask::is_running))
        {
            let scene = self.editor.scene().clone();
            let placements = self.editor.placements();
            self.rays = Some(reference::cast(scene, placements, self.version, self.setup.seed));
            self.rays_version = self.version;
        }
        if self.editor.error && current && !self.pending.light() {
            self.compare()?;
        }
        Ok(())
    }

    /// Computes the error's colours for the last merge, unless they are known.
    pub(super) fn compare(&mut self) -> Result<()> {
        let (Some(frame), Some(reference)) = (&mut self.frame, &self.reference) else { return Ok(()) };
        if frame.stale_count() > 0 {
            // Some clusters are out of date; the next frame merges them.
            return Ok(());
        }
        if self
            .error_shown
            .as_ref()
            .is_some_and(|(version, rays, _)| (*version, *rays) == (self.version, reference.rays))
        {
            return Ok(());
        }
        let map = ErrorMap::new(&error_map::radiosity(frame)?, &reference.radiosity);
        let scale = map.scale();
        frame.set_comparison(ERROR, &map.colors(&scale), NEUTRAL)?;
        let shown = ErrorScale { rms: map.rms(), limit: scale.limit };
        self.error_shown = Some((self.version, reference.rays, shown));
        self.pending |= Changed { display: true, ..Changed::default() };
        Ok(())
    }
}
