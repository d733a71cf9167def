//! Checks whether a scene fits a device, before anything is baked.

use super::ALIGNMENT;
use crate::bake::{SceneNeeds, bakes_transfer};
use crate::error::{Error, Result};
use crate::field::quantity::channel_stride;
use crate::gpu::Device;
use crate::scene::Scene;
use ash::vk;

/// Refuses a scene that the device cannot hold, before anything is baked.
pub fn check(device: &Device, scene: &Scene, baked: &SceneNeeds) -> Result<()> {
    let needs = Needs::of(scene, baked.field_bytes(ALIGNMENT), baked.options.bands);
    needs.check(&device.limits, device.heap_bytes())
}

/// Bytes that a scene keeps on the device, by buffer. Each is bound as a whole.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Needs {
    pub fields: u64,
    /// Transfer vectors of the lit meshes that can shadow themselves.
    pub transfers: u64,
    /// Positions and normals of all meshes.
    pub vertices: u64,
    /// Light on the vertices of all entities.
    pub radiosity: u64,
    /// Meshes as they are drawn. No shader binds them.
    pub drawables: u64,
}

impl Needs {
    /// The needs of a scene whose fields take `fields` bytes.
    pub fn of(scene: &Scene, fields: u64, bands: usize) -> Self {
        let vertices = |mesh: usize| scene.meshes[mesh].positions.len() as u64;
        let lit = |mesh: usize| scene.entities.iter().any(|e| e.mesh == mesh && e.receives);
        let mut needs = Needs { fields, ..Default::default() };
        let channel = 4 * channel_stride(bands) as u64;
        for (index, mesh) in scene.meshes.iter().enumerate() {
            needs.vertices += 32 * vertices(index);
            needs.drawables += 24 * vertices(index) + 12 * mesh.triangles.len() as u64;
            if lit(index) && bakes_transfer(mesh) {
                needs.transfers += channel * vertices(index);
            }
        }
        needs.radiosity = scene.entities.iter().map(|e| 16 * vertices(e.mesh)).sum();
        needs
    }

    /// Refuses what the device cannot hold.
    pub fn check(&self, limits: &vk::PhysicalDeviceLimits, heap_bytes: u64) -> Result<()> {
        let most = u64::from(limits.max_storage_buffer_range);
        let fewer = "use fewer vertices";
        let buffers = [
            ("fields take", self.fields, "use a smaller --lattice or f16 storage"),
            ("transfer vectors take", self.transfers, "use fewer vertices or --bands"),
            ("vertices take", self.vertices, fewer),
            ("light on vertices takes", self.radiosity, fewer),
        ];
        if let Some((what, bytes, help)) = buffers.into_iter().find(|(_, bytes, _)| *bytes > most) {
            return Err(Error::Input(format!("the scene's {what} {bytes} bytes, the device can bind {most}: {help}")));
        }
        let all = self.fields + self.transfers + self.vertices + self.radiosity + self.drawables;
        if all > heap_bytes {
            return Err(Error::Input(format!(
                "the scene takes {all} bytes of device memory, the device has {heap_bytes}: {fewer} or a smaller --lattice"
            )));
        }
        Ok(())
    }
}

/// Entries that a merge takes on a software device: llvmpipe (Mesa 22.3) ends all loops of an invocation after 65 535
/// iterations together, without a word, and an entry takes up to two.
const SOFTWARE_ENTRIES: u32 = 30_000;

/// Refuses a list of entries that is longer than a software device goes through.
pub fn check_entries(longest: u32) -> Result<()> {
    if longest > SOFTWARE_ENTRIES {
        return Err(Error::Input(format!(
            "{longest} lookups of occluders and lights matter to one cluster of vertices, a software device makes at most {SOFTWARE_ENTRIES}: \
             use fewer lights or occluders, or a larger --eps"
        )));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    /// Each kind in turn is one byte too large for a made-up device.
    #[test]
    fn what_does_not_fit_is_refused_with_numbers() {
        let text = "[camera]\neye = [0, 0, 5]\ntarget = [0, 0, 0]\n[[mesh]]\nname = \"ring\"\n\
            torus = { major_m = 0.3, minor_m = 0.1, segments = 12, sides = 6 }\n\
            [[entity]]\nmesh = \"ring\"\n[[entity]]\nmesh = \"ring\"\n";
        let scene = Scene::parse(text, Path::new("test.toml"), &crate::asset::embedded::read).unwrap();
        let count = scene.meshes[0].positions.len() as u64;
        let needs = Needs::of(&scene, 5000, 4);
        let drawables = 24 * count + 12 * scene.meshes[0].triangles.len() as u64;
        let expected =
            Needs { fields: 5000, transfers: 64 * count, vertices: 32 * count, radiosity: 32 * count, drawables };
        assert_eq!(needs, expected);
        let limits =
            |bytes: u64| vk::PhysicalDeviceLimits { max_storage_buffer_range: bytes as u32, ..Default::default() };
        let all = 5000 + 128 * count + drawables;
        assert!(needs.check(&limits(5000.max(64 * count)), all).is_ok());
        let refused = |needs: Needs, most: u64, heap: u64| needs.check(&limits(most), heap).unwrap_err().to_string();
        for (needs, what) in [
            (Needs { fields: 1001, ..Default::default() }, "fields"),
            (Needs { transfers: 1001, ..Default::default() }, "transfer vectors"),
            (Needs { vertices: 1001, ..Default::default() }, "vertices"),
            (Needs { radiosity: 1001, ..Default::default() }, "light on vertices"),
        ] {
            let message = refused(needs, 1000, 1 << 20);
            assert!(message.contains(what) && message.contains("1001") && message.contains("1000"), "{message}");
        }
        let message = refused(needs, 1 << 20, all - 1);
        assert!(message.contains(&all.to_string()) && message.contains(&(all - 1).to_string()), "{message}");
        assert_eq!(needs.check(&limits(1), all).unwrap_err().exit_code(), 4);
    }

    #[test]
    fn a_list_beyond_the_loop_limit_is_refused_with_numbers() {
        check_entries(SOFTWARE_ENTRIES).unwrap();
        let error = check_entries(SOFTWARE_ENTRIES + 1).unwrap_err();
        assert_eq!(error.exit_code(), 4);
        assert!(error.to_string().contains("30001") && error.to_string().contains("--eps"), "{error}");
    }
}
