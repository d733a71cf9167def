//! A frame on one screen: upload, passes in order, the barriers between them.
//!
//! ```text
//! placements -> entities, rotations, clusters to merge (host) -> gather (device or host) -> entries of every cluster -> merge -> radiosity -> draw -> picture -> read back
//! ```

mod draw_twin;
mod form;
mod live;
pub mod memory;
mod picture;
mod pose;
mod twin;

use crate::asset::edges::Edges;
use crate::bake;
use crate::bake::Baker;
use crate::bake::cache::Cache;
use crate::draw::smooth::Lines;
use crate::draw::{Antialias, Draw, Finish};
use crate::error::Result;
use crate::field::Lookup;
use crate::field::quantity::channel_stride;
use crate::gpu::{Access, Buffer, BufferKind, Commands, Device, Timing, Upload, Volume};
use crate::layout;
use crate::lists::gather::Place;
use crate::lists::gathering::Gathering;
use crate::lists::incremental::{ClusterLists, Merged};
use crate::lists::skip::Skip;
use crate::merge::calibrate;
use crate::merge::variant::{Chain, Form, Variant, uniform_entities};
use crate::merge::{Inputs, Merge, Readable};
use crate::scene::{Placement, Scene};
use crate::scene_buffers::{Progress, Store};
use crate::sh::basis::{Y00, coefficient_count};
use crate::shaders::Library;
use ash::vk;
use form::{form, usable};
use glam::Vec3;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

pub use live::{Lit, Part, is_cached};

/// What decides a frame besides the scene.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Fields and transfers.
    pub bake: bake::Options,
    /// Which samples a lookup takes.
    pub lookup: Lookup,
    /// How the merge is done; `None` takes what was measured to be the device's fastest.
    pub variant: Option<Variant>,
    /// What the merge leaves out.
    pub skip: Skip,
    /// How occluders are multiplied.
    pub chain: Chain,
    /// Light that the merge leaves out: contributions to a vertex that are bounded below this share of the radiance that the
    /// scene's exposure shows as white; 0 leaves none out.
    pub eps: f32,
    /// Where the lists of clusters are made; `None` takes what is known to be quicker on the device.
    pub lists: Option<Place>,
    /// Width and height of the picture in pixels.
    pub size: [u32; 2],
    /// How edges are kept from showing as stairs.
    pub antialias: Antialias,
}

/// A scene on a device, ready to be lit and drawn at any time.
pub struct Frame {
    device: Arc<Device>,
    scene: Scene,
    options: Options,
    /// Baked and uploaded data.
    pub store: Store,
    /// Variant in use.
    pub variant: Variant,
    form: Form,
    /// Fields as the variant's sampler reads them.
    image: Option<Volume>,
    merge: Merge,
    draw: Draw,
    library: Library,
    entities: Upload,
    clusters: Upload,
    entries: Upload,
    sky: Upload,
    radiosity: Buffer,
    radiosity_offsets: Vec<u64>,
    readback: Buffer,
    lists: ClusterLists,
    /// Where the device makes the lists.
    gathering: Option<Gathering>,
    /// What the last frame did about its clusters.
    pub merged: Merged,
    /// Whether the merge that was prepared last was recorded.
    recorded: AtomicBool,
    /// Largest radiance of the sky as projected, of any colour.
    sky_radiance: f64,
    background: Vec3,
    /// Radiosity from elsewhere that is shown beside the merged one or in its place.
    panels: [Option<Buffer>; 2],
    /// Outlines and creases of the picture that was prepared last, and which of them belong to each of its parts.
    lines: Lines,
    line_ranges: Vec<Range<u32>>,
    /// Edges of each mesh, once a picture wants its outlines.
    edges: Vec<Edges>,
}

impl Frame {
    /// Bakes or finds what the scene needs and builds the passes.
    ///
    /// # Errors
    /// As [`Store::new`], [`Merge::new`] and [`Draw::new`]; `Usage` as [`crate::merge::variant::Product::check`].
    pub fn new(baker: &Baker, cache: &Cache, scene: &Scene, options: Options, progress: Progress<'_>) -> Result<Self> {
        let (device, library) = (baker.device(), baker.library());
        options.chain.product.check(options.bake.bands, options.bake.occlusion_bands())?;
        let store = Store::new(baker, cache, scene, &options.bake, options.skip, progress)?;
        let wanted = options.variant.unwrap_or_else(|| calibrate::best_known(device));
        let (form, image) =
            usable(device, &store, scene.entities.len(), form(&options, wanted, uniform_entities(device)))?;
        let (variant, entity_limit) = (form.variant, form.entity_limit);

        let mut radiosity_offsets = Vec::new();
        let (mut radiosity_size, mut lists) = (0, ClusterLists::default());
        for (index, entity) in scene.entities.iter().enumerate() {
            let geometry = &store.geometries[entity.mesh];
            radiosity_offsets.push(radiosity_size);
            if entity.receives {
                lists.add(index, pose::clusters(index, geometry, radiosity_size / 16, options.bake.bands));
            }
            radiosity_size += 16 * geometry.vertices.len() as u64;
        }
        let merge = Merge::new(device, library, form)?;
        let gathers = options.lists.unwrap_or_else(|| Place::quicker(device, scene.entities.len())) == Place::Device
            && !lists.clusters.is_empty();
        let gathering = gathers.then(|| Gathering::new(device, library, &lists, scene.entities.len())).transpose()?;
        let draw = Draw::new(device, library, options.size, options.antialias, Finish::Linear)?;
        let count = scene.entities.len().max(entity_limit as usize) as u64;
        let upload = |name: &str, bytes: u64| Upload::new(device, name, bytes);
        let bands = options.bake.bands;
        let mut radiosity = Buffer::new(device, "radiosity", BufferKind::Device, radiosity_size.max(16))?;
        radiosity.fill(0, &vec![0.0_f32; radiosity.size_bytes as usize / 4])?;
        let mut frame = Frame {
            device: device.clone(),
            scene: scene.clone(),
            options,
            variant,
            form,
            image,
            merge,
            draw,
            library: library.clone(),
            panels: Default::default(),
            lines: Lines::new(device)?,
            line_ranges: Vec::new(),
            edges: Vec::new(),
            entities: upload("entities", count * size_of::<layout::Entity>() as u64)?,
            clusters: upload("clusters", (lists.clusters.len() * size_of::<layout::Cluster>()) as u64)?,
            entries: upload("entries", 4 * lists.clusters.len() as u64)?,
            sky: upload("sky", 12 * channel_stride(bands) as u64)?,
            radiosity,
            radiosity_offsets,
            readback: Buffer::new(
                device,
                "readback",
                BufferKind::Readback,
                8 * u64::from(options.size[0]) * u64::from(options.size[1]),
            )?,
            lists,
            gathering,
            merged: Merged::default(),
            recorded: AtomicBool::new(true),
            sky_radiance: 0.0,
            background: Vec3::ZERO,
            store,
        };
        frame.write_sky()?;
        Ok(frame)
    }

    /// Writes the sky's coefficients and takes the background from them.
    fn write_sky(&mut self) -> Result<()> {
        let bands = self.options.bake.bands;
        let channels = self.scene.environment.coefficients(bands);
        let stride = channel_stride(bands);
        let mut floats = vec![0.0_f32; 3 * stride];
        for (to, from) in floats.chunks_exact_mut(stride).zip(&channels) {
            to.iter_mut().zip(&from[..coefficient_count(bands)]).for_each(|(to, from)| *to = *from as f32);
        }
        self.sky_radiance = pose::brightest(&channels, bands);
        self.background = Vec3::from_array(channels.map(|c| (c[0] * Y00) as f32));
        self.lists.renew();
        self.sky.write(&floats)
    }

    /// Lights every receiver as far as anything has changed since the last call, and draws the picture where `white` is given:
    /// radiance above it is brought down to it, hue kept, before samples are averaged, so that edges of lights are smooth;
    /// infinity leaves radiance as it is. Returns each pass's duration.
    ///
    /// While things move a picture lights only what it may show ([`Skip::hidden`]): whoever wants radiosity rather than a picture
    /// calls this without `white`, which lights everything.
    ///
    /// # Errors
    /// `Device` when the device was lost, `Failed` when a barrier is missing.
    pub fn render(&mut self, placements: &[Placement], white: Option<f32>) -> Result<Vec<Timing>> {
        let outcome = self.light_and_draw(placements, white);
        if outcome.is_err() {
            // Perhaps nothing ran: no cluster can be taken for merged.
            self.lists.forget();
        }
        outcome
    }

    fn light_and_draw(&mut self, placements: &[Placement], white: Option<f32>) -> Result<Vec<Timing>> {
        let parts: &[Part] = if white.is_some() { &[self.whole(Lit::Merged)] } else { &[] };
        if white.is_some() {
            self.prepare_picture(placements, parts)?;
        }
        loop {
            self.upload(placements, parts)?;
            let items = self.items(placements, self.options.size);
            let mut commands = Commands::new(&self.device, "frame")?;
            self.record_merge(&mut commands)?;
            if let Some(white) = white {
                if self.merged.merged_clusters > 0 {
                    commands.barrier(Access::ComputeWrite, Access::VertexRead);
                    commands.barrier(Access::ComputeWrite, Access::FragmentSampled);
                }
                self.record_file(&mut commands, &items, self.background, white)?;
            }
            let timings = commands.submit()?;
            if self.all_gathered() {
                return Ok(timings);
            }
        }
    }

    /// The passes that bring light to the clusters of the last upload; nothing where there are none.
    fn record_merge<'f>(&'f self, commands: &mut Commands<'f>) -> Result<()> {
        let cluster_count = self.merged.merged_clusters as u32;
        if cluster_count == 0 {
            return Ok(());
        }
        if let Some(gathering) = &self.gathering {
            gathering.record(commands, &self.entities, &self.clusters)?;
        }
        let inputs = self.inputs()?;
        commands.pass("merge", |c| self.merge.record(c, &inputs, &self.radiosity, cluster_count))
    }

    /// Replaces the radiosity of an entity's vertices, in the mesh's order, until the next merge: for pictures of what was computed elsewhere.
    ///
    /// # Errors
    /// `Device` when memory ran out.
    pub fn set_radiosity(&mut self, entity: usize, radiosity: &[[f32; 3]]) -> Result<()> {
        self.lists.forget();
        let order = &self.store.geometries[self.scene.entities[entity].mesh].order;
        assert_eq!(radiosity.len(), order.len(), "radiosity of entity {entity}");
        let quad = |&v: &u32| {
            let [r, g, b] = radiosity[v as usize];
            [r, g, b, 0.0]
        };
        let quads: Vec<[f32; 4]> = order.iter().map(quad).collect();
        self.radiosity.fill(self.radiosity_offsets[entity], &quads)
    }

    /// Radiosity of an entity's vertices in the mesh's order: linear RGB radiance that leaves the surface, without emission;
    /// zero where it does not receive. After a picture of things that move, what it does not show may be of an earlier moment;
    /// see [`Frame::render`].
    ///
    /// # Errors
    /// `Device` when memory ran out.
    pub fn radiosity(&self, entity: usize) -> Result<Vec<[f32; 3]>> {
        let first = self.radiosity_offsets[entity];
        let count = self.store.geometries[self.scene.entities[entity].mesh].vertices.len() as u64;
        let quads: Vec<[f32; 4]> = self.radiosity.download_range(first..first + 16 * count)?;
        let mut out = vec![[0.0; 3]; quads.len()];
        let order = &self.store.geometries[self.scene.entities[entity].mesh].order;
        for (&v, [r, g, b, _]) in order.iter().zip(quads) {
            out[v as usize] = [r, g, b];
        }
        Ok(out)
    }

    /// The scene that the frame was built for.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Width and height of its pictures in pixels.
    pub fn size(&self) -> [u32; 2] {
        self.options.size
    }

    /// Vertices that are lit.
    pub fn receiver_vertex_count(&self) -> usize {
        self.lists.clusters.iter().map(|cluster| cluster.vertex_count as usize).sum()
    }

    /// Clusters whose light is of an earlier moment, as no picture since then showed them.
    pub fn stale_count(&self) -> usize {
        self.lists.stale_count()
    }

    /// Merges every cluster in the next frame, moved or not.
    pub fn forget(&mut self) {
        self.lists.forget();
    }

    fn inputs(&self) -> Result<Inputs<'_>> {
        let floats = vk::Format::R32G32B32A32_SFLOAT;
        Ok(Inputs {
            entities: Readable::shared(&self.entities, self.variant)?,
            entries: self.gathering.as_ref().and_then(Gathering::entries).unwrap_or(&self.entries),
            clusters: &self.clusters,
            fields: Readable::fields(&self.store.fields, self.image.as_ref(), &self.form)?,
            transfers: Readable::new(&self.store.transfers, self.variant, floats)?,
            vertices: Readable::new(&self.store.vertices, self.variant, floats)?,
            sky: Readable::new(&self.sky, self.variant, floats)?,
        })
    }
}
