//! A scene on a device, lit and drawn again and again. [`record()`] is one frame from top to bottom: its passes in
//! order, with all barriers between them. The other files prepare what those passes read.
//!
//! ```text
//! placements -> what an entity is now (pose) -> dirty clusters, chains of pixels, outlines (prepare) -> record
//!            -> what each viewport shows of it (viewport) --------------------------------------------> record
//! record -> window, image or file
//! ```

mod change;
mod draw_twin;
mod gloss;
mod light_maps;
mod memory;
mod mirror;
mod options;
mod permutation;
mod picture;
mod pixel;
mod pose;
mod prepare;
mod probe;
mod radiosity;
mod record;
mod seams;
mod sky;
mod twin;
mod viewport;

use crate::bake::cache::Cache;
use crate::bake::ensure::SceneProgress;
use crate::bake::surfaces::{SurfacePlan, crisp_suns};
use crate::bake::{self, Baker, SceneNeeds};
use crate::bounce::{Bounce, BounceWork, Bounces, Linked, LinkedEntity};
use crate::draw::Shading;
use crate::draw::lamp_map::LampMaps;
use crate::draw::sun_map::SunMaps;
use crate::error::Result;
use crate::gloss::Reflections;
use crate::gpu::{self, Bind, Buffer, Commands, Device, Timing};
use crate::layout::{CLUSTER_FORMAT, ENTRY_FORMAT, QUAD_FORMAT};
use crate::lists::incremental::{ClusterLists, Merged};
use crate::merge::variant::{MergePermutation, Reads, Variant, uniform_entities};
use crate::merge::{Merge, MergeInputs, calibrate};
use crate::scene::groups::Groups;
use crate::scene::{LightMethod, Lights, Placement, Scene, light};
use crate::scene_buffers::{SceneBuffers, limits};
use crate::shaders::Library;
use crate::sharp::{self, Sharp, SharpPermutation};
use glam::Vec3;
use light_maps::{StoodLamp, ToldSun};
use permutation::{permutation, pixel_shading, usable};
use picture::FramePicture;
use pixel::PixelChains;
use prepare::ClusterWork;
use radiosity::RadiosityBuffers;
use sky::SkyLight;
use std::ops::Range;
use std::sync::Arc;

pub use memory::PictureMemory;
#[cfg(feature = "cli")]
pub use options::picture_size;
pub use options::{Options, RenderOptions};
pub use record::{MergeWork, PictureTarget, PictureWork, record};
pub use viewport::{RadiositySource, Viewport};

/// How the light of each entity of a scene is computed.
fn methods(scene: &Scene, lights: Lights) -> Vec<LightMethod> {
    (0..scene.entities.len()).map(|entity| LightMethod::of(scene, entity, lights)).collect()
}

/// Albedo of each entity.
fn albedos(scene: &Scene) -> Vec<Vec3> {
    scene.entities.iter().map(|entity| entity.albedo).collect()
}

/// A scene on a device, ready to be lit and drawn at any time.
pub struct Frame {
    device: Arc<Device>,
    library: Library,
    scene: Scene,
    /// Which entities never move against each other.
    pub(crate) groups: Groups,
    /// The suns of which vertices tell whether they are hidden, in the order of their bits.
    told_suns: Vec<ToldSun>,
    /// Lamps that have maps.
    stood_lamps: Vec<StoodLamp>,
    /// What stands in maps.
    casters: Vec<usize>,
    /// What occludes and rested when that was baked, and where.
    stood: Vec<(usize, Placement)>,
    /// How far the rectangles that entities are reach into boxes; see [`seams::reaches`].
    reaches: Vec<[f64; 2]>,
    /// What the own visibility of the vertices was baked for.
    surfaces: SurfacePlan,
    methods: Vec<LightMethod>,
    /// Boxes as which entities block sharp lights, behind the entities on all lists: entity, and number of its box.
    boxes: Vec<[usize; 2]>,
    options: Options,
    /// Baked and uploaded data.
    pub buffers: SceneBuffers,
    merge: Merge,
    /// The pass of sharp lights, if the scene has any.
    sharp: Option<Sharp>,
    work: ClusterWork,
    sky: SkyLight,
    /// Chains of sharp lights for pixels, once a picture evaluates any.
    chains: Option<PixelChains>,
    radiosity: RadiosityBuffers,
    /// What passes light on within rigid groups, where it bounces.
    bounce: Option<Bounce>,
    reflections: Option<Reflections>,
    reflectors: mirror::Reflectors,
    /// Maps of suns, once a picture evaluates lights by them.
    sun_maps: Option<SunMaps>,
    /// Maps of lamps, from the first frame on.
    lamp_maps: Option<LampMaps>,
    picture: FramePicture,
}

impl Frame {
    /// Bakes or finds what the scene needs and builds the passes.
    pub fn new(
        baker: &Baker,
        cache: &Cache,
        scene: &Scene,
        options: Options,
        progress: SceneProgress<'_>,
    ) -> Result<Self> {
        let device = baker.device();
        let library = baker.library();
        let needs = SceneNeeds::of(scene, &options.baked(), options.lights);
        limits::check(device, &needs)?;
        PictureMemory::new(device, &options).check(device)?;
        let mut baked = bake::ensure(baker, cache, scene, &needs, progress)?;
        log::debug!("all that is baked is there");
        let mut near = std::mem::take(&mut baked.near);
        let mut scene = scene.clone();
        let links: Vec<_> = baked.surface_of.iter().map(|&surface| baked.surfaces[surface].links.clone()).collect();
        let rigid = std::mem::take(&mut baked.rigid);
        scene.surfaces = baked.surface_of.iter().map(|&surface| baked.surfaces[surface].mesh.clone()).collect();
        let buffers = SceneBuffers::new(device, &scene, &options.bake, baked)?;
        log::debug!("it is on the device");
        let boxes = scene.boxes();
        let entity_count = scene.entities.len() + boxes.len();
        let wanted = options.variant.unwrap_or_else(|| calibrate::best_known(device));
        let methods = methods(&scene, options.lights);
        let mut radiosity = RadiosityBuffers::new(device, &scene, &buffers)?;
        let wanted = permutation(&options, wanted, &scene, &methods, uniform_entities(device));
        let wanted = MergePermutation { volume: buffers.volume.is_some(), ..wanted };
        let placements = scene.at(0.0);
        let screens = scene.screens();
        let linked = |(entity, links)| LinkedEntity {
            mesh: scene.surface(entity),
            order: &buffers.surface(entity).order,
            runs: &buffers.surface(entity).runs,
            first: radiosity.offsets[entity] as usize / 16,
            centre_m: buffers.meshes[scene.entities[entity].mesh].centre_m,
            radius_m: buffers.meshes[scene.entities[entity].mesh].radius_m,
            reflects: scene.entities[entity].occludes && buffers.shadows(&scene, entity),
            cuboid: scene.casts_as_box(entity).then(|| scene.caster(scene.entities[entity].mesh).cuboid()).flatten(),
            is_screen: screens.contains(&entity),
            rests: scene.is_at_rest(entity),
            placement: placements[entity],
            receives: scene.entities[entity].receives,
            links,
        };
        let bounces = options.bounces != Bounces::None;
        let linked = bounces
            .then(|| links.into_iter().enumerate().map(linked).collect::<Vec<_>>())
            .and_then(|entities| Linked::new(&entities, &rigid, buffers.volume.clone()));
        let reflections = gloss::reflections(
            device,
            library,
            &scene,
            &methods,
            &buffers,
            radiosity.merged.size_bytes,
            wanted.variant.reads == Reads::Texels && linked.as_ref().is_none_or(|linked| linked.fits_texels(device)),
            linked.is_some(),
        )?;
        let wanted = MergePermutation { gloss: reflections.is_some(), ..wanted };
        let permutation = usable(device, &buffers, entity_count, wanted);
        let sharp = permutation::sharp(&options, &permutation, &methods, &scene, &buffers);
        if sharp.is_some() {
            radiosity.keep_soft()?;
        }
        let threads = if device.info.is_software() { gpu::driver_threads() } else { 1 };
        let mut lists = ClusterLists::new(threads);
        for (index, _) in scene.entities.iter().enumerate().filter(|(_, entity)| entity.receives) {
            lists.add(
                index,
                pose::clusters(index, buffers.surface(index), radiosity.offsets[index] / 16, options.bake.bands),
            );
            lists.set_near(std::mem::take(&mut near[index]), 2.0 * buffers.surface(index).reach_m);
        }
        let sharp = sharp.map(|wanted| wanted.fitting(device, buffers.sharp(), radiosity.soft()));
        let pixels = pixel_shading(device, &options, &buffers, radiosity.soft(), sharp);
        if options.shading == Some(Shading::Pixel) && sharp.is_some() && pixels.is_none() {
            log::warn!(
                "no pixel evaluates lights: the device's texel buffers cannot hold the silhouette fields or the light of all vertices"
            );
        }
        let self_cells = buffers.has_self_shadows().then_some(&buffers.self_cells);
        let soft = sharp.is_some();
        let sharp =
            sharp.map(|fitting| SharpPermutation { edges: pixels.is_some(), lamps: linked.is_some(), ..fitting });
        if sharp.is_some_and(|permutation| permutation.edges) {
            radiosity.keep_irradiances(&scene, &methods)?;
        }
        let reflectors = reflections.is_some().then(|| mirror::reflectors(&scene)).unwrap_or_default();
        let lights = reflectors.lights(options.bounces, pixels, sharp);
        if lights.mirrors > 0 && !bounces {
            radiosity.keep_dark()?;
        }
        let mut picture = FramePicture::new(device, library, &options, lights)?;
        // Shaders take long to compile, so that this is done on all cores, those that take longest first.
        picture.draw.is_made = options.pictures;
        let glossy = reflections.is_some();
        let drawing = || if options.pictures { picture.make_pipelines(&scene, &buffers, glossy) } else { Ok(()) };
        let merging = || Merge::new(device, library, permutation);
        let lighting = || sharp.map(|permutation| Sharp::new(device, library, permutation)).transpose();
        let bouncing = || linked.map(|linked| Bounce::new(device, library, linked, soft, permutation, self_cells));
        let (drawing, (sharp, (merge, bounce))) =
            rayon::join(drawing, || rayon::join(lighting, || rayon::join(merging, bouncing)));
        drawing?;
        let mut bounce = bounce.transpose()?;
        if let Some(bounce) = &mut bounce {
            bounce.set_albedos(&albedos(&scene))?;
            radiosity.keep_direct()?;
        }
        log::debug!("all passes are made");
        let entity_room = entity_count.max(permutation.entity_limit as usize);
        let mut sky = SkyLight::new(device, options.bake.bands, buffers.volume_quads())?;
        sky.write(&scene, options.bake.bands)?;
        Ok(Frame {
            device: device.clone(),
            library: library.clone(),
            told_suns: crisp_suns(&scene)
                .map(|(place, sun)| (scene.data.entities.len() + place, sun))
                .map(|(entity, sun)| ToldSun { entity, stood: placements[entity], sun })
                .collect(),
            stood_lamps: light_maps::mapped_lamps(&scene, &methods),
            casters: light_maps::casters(&scene),
            stood: (0..scene.data.entities.len())
                .filter(|&entity| scene.entities[entity].occludes && scene.is_at_rest(entity))
                .map(|entity| (entity, placements[entity]))
                .collect(),
            reaches: seams::reaches(&scene, &placements),
            scene,
            groups: needs.groups,
            surfaces: needs.surfaces,
            methods,
            boxes,
            sharp: sharp?,
            options,
            merge: merge?,
            work: ClusterWork::new(device, lists, entity_room)?,
            sky,
            radiosity,
            picture,
            reflections,
            reflectors,
            chains: None,
            sun_maps: None,
            lamp_maps: None,
            bounce,
            buffers,
        })
    }

    /// Lights every receiver as far as anything has changed since the last call, and draws the picture where `white` is
    /// given: radiance above it is brought down to it, hue kept, before samples are averaged, so that edges of lights
    /// are smooth; infinity leaves radiance as it is. The host can read the picture afterwards. Returns each pass's
    /// duration.
    pub fn render(&mut self, placements: &[Placement], white: Option<f32>) -> Result<Vec<Timing>> {
        self.light_and_draw(placements, white, true)
    }

    /// As [`Frame::render`] with a picture that stays on the device, where a window would show it.
    pub fn show(&mut self, placements: &[Placement], white: f32) -> Result<Vec<Timing>> {
        self.light_and_draw(placements, Some(white), false)
    }

    fn light_and_draw(&mut self, placements: &[Placement], white: Option<f32>, reads: bool) -> Result<Vec<Timing>> {
        let viewports: &[Viewport] = if white.is_some() { &[self.whole()] } else { &[] };
        let outcome = self.prepare(placements, viewports, true).and_then(|()| {
            let picture = white.map(|white| self.picture_work(placements, white));
            self.run(self.merge_work()?.as_ref(), picture.as_ref(), reads)
        });
        if outcome.is_err() {
            // The device may have run none of it, so every cluster must be merged again.
            self.forget();
        }
        outcome
    }

    /// Draws the picture from the radiosity as it stands.
    pub fn redraw(&mut self, placements: &[Placement], white: f32) -> Result<Vec<Timing>> {
        self.prepare(placements, &[self.whole()], false)?;
        self.run(None, Some(&self.picture_work(placements, white)), true)
    }

    /// Draws the comparison at place 0 ([`Frame::set_comparison`]), of values that are not radiance: no emission, no
    /// limit to white, and the given background.
    pub fn draw_comparison(&mut self, placements: &[Placement], background: [f32; 3]) -> Result<Vec<Timing>> {
        let radiosity = RadiositySource::Comparison(0);
        let viewport = Viewport { radiosity, adds_emission: false, ..self.whole() };
        self.prepare(placements, &[viewport], false)?;
        let picture = self.picture_work(placements, f32::INFINITY);
        self.run(None, Some(&PictureWork { background: background.into(), ..picture }), true)
    }

    /// Records a frame for a file or a bench, and waits for its end. The picture, if there is one, is read back where
    /// `reads` says so.
    fn run<'f>(
        &'f self,
        merge: Option<&MergeWork<'f>>,
        picture: Option<&PictureWork<'f>>,
        reads: bool,
    ) -> Result<Vec<Timing>> {
        let host = PictureTarget::Host { picture: self.shown(), readback: &self.picture.readback };
        let target = if reads && picture.is_some() { host } else { PictureTarget::Device };
        let mut commands = Commands::new(&self.device, "frame")?;
        record(&mut commands, merge, picture, target)?;
        commands.submit()
    }

    /// What [`record()`] needs to do the merge that [`Frame::prepare`] has prepared; `None` where no cluster has
    /// changed. When the recording does not run, call [`Frame::forget`].
    pub fn merge_work(&self) -> Result<Option<MergeWork<'_>>> {
        let cluster_count = self.work.start();
        if cluster_count == 0 {
            return Ok(None);
        }
        Ok(Some(MergeWork {
            cluster_count,
            inputs: self.inputs(&self.merge.permutation)?,
            merge: &self.merge,
            sharp: self.sharp.as_ref().map(|sharp| (sharp, self.sharp_inputs())),
            soft: self.radiosity.soft_direct(),
            radiosity: self.radiosity.direct(),
            bounce: self.bounce.as_ref().map(|bounce| Ok((bounce, self.bounce_work(bounce)?))).transpose()?,
        }))
    }

    fn bounce_work(&self, bounce: &Bounce) -> Result<BounceWork<'_>> {
        let inputs = bounce.reads().map(|permutation| self.inputs(permutation)).transpose()?;
        Ok(BounceWork {
            entities: &self.work.entities,
            light: self.radiosity.bounced(),
            steps: bounce.steps(self.options.bounces),
            met: inputs.map(|inputs| (inputs, self.buffers.has_self_shadows().then_some(&self.buffers.self_cells))),
        })
    }

    fn sharp_inputs(&self) -> sharp::SharpInputs<'_> {
        sharp::SharpInputs {
            entities: &self.work.entities,
            entries: &self.work.entries,
            clusters: &self.work.clusters,
            nodes: &self.buffers.silhouettes.nodes,
            cells: &self.buffers.silhouettes.cells,
            vertices: &self.buffers.vertices,
            self_cells: &self.buffers.self_cells,
            soft: self.radiosity.soft_direct(),
            shown: self.kept_for_gloss().map(|[_, lights, shares]| [lights, shares]),
            lamps: self.radiosity.lamps(),
            irradiances: self.radiosity.irradiances(),
            lamp_maps: self.lamp_maps.as_ref().map(|found| [&found.maps, &found.texels]),
        }
    }

    fn inputs(&self, permutation: &MergePermutation) -> Result<MergeInputs<'_>> {
        let read = |buffer, format| Bind::read(permutation.variant.reads == Reads::Texels, buffer, format);
        Ok(MergeInputs {
            entities: read(&self.work.entities, QUAD_FORMAT)?,
            entries: read(&self.work.entries, ENTRY_FORMAT)?,
            clusters: read(&self.work.clusters, CLUSTER_FORMAT)?,
            fields: read(&self.buffers.fields, permutation.field_format())?,
            transfers: read(&self.buffers.transfers, QUAD_FORMAT)?,
            vertices: read(&self.buffers.vertices, QUAD_FORMAT)?,
            sky: read(&self.sky.coefficients, QUAD_FORMAT)?,
            through: self.kept_for_gloss().map(|[through, ..]| through),
        })
    }

    fn order(&self, entity: usize) -> &[u32] {
        &self.buffers.surface(entity).order
    }

    /// Radiosity of an entity's vertices in the mesh's order: linear RGB radiance that leaves the surface, without
    /// emission; zero where it does not receive.
    pub fn radiosity(&self, entity: usize) -> Result<Vec<[f32; 3]>> {
        self.radiosity.read(entity, self.order(entity))
    }

    /// The buffer of all radiosity, and for every entity its bytes in it and the order in which its mesh's vertices
    /// stand there.
    pub fn light_buffer(&self) -> (&Buffer, Vec<(Range<u64>, &[u32])>) {
        let of = |entity| (self.radiosity.bytes(entity, self.order(entity).len()), self.order(entity));
        (&self.radiosity.merged, (0..self.scene.entities.len()).map(of).collect())
    }

    /// Radiosity of every entity's vertices from elsewhere, by entity in the mesh's order, for
    /// [`RadiositySource::Comparison`] of that place: 0 or 1. Entities that are not named are `rest`.
    pub fn set_comparison(&mut self, place: usize, radiosity: &[(usize, Vec<[f32; 3]>)], rest: [f32; 3]) -> Result<()> {
        let order = |entity: usize| &self.buffers.surface(entity).order[..];
        let entities = radiosity.iter().map(|(entity, values)| (*entity, order(*entity), &values[..]));
        self.radiosity.compare(place, entities, rest)
    }

    /// The scene that the frame was built for.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Width and height of its pictures in pixels.
    pub fn size(&self) -> [u32; 2] {
        self.options.size
    }

    pub fn variant(&self) -> Variant {
        self.merge.permutation.variant
    }

    pub fn permutation(&self) -> MergePermutation {
        self.merge.permutation
    }

    /// What the last frame did about its clusters.
    pub fn merged(&self) -> Merged {
        self.work.merged
    }

    pub fn receiver_vertex_count(&self) -> usize {
        self.work.lists.members.iter().map(|member| member.cluster.vertex_count as usize).sum()
    }

    /// Whether any light goes through spherical harmonics, so that transfer vectors are baked.
    pub fn has_harmonics(&self) -> bool {
        light::has_harmonics(&self.scene, self.options.lights)
    }

    /// Merges every cluster in the next frame, moved or not.
    pub fn forget(&mut self) {
        self.work.lists.forget();
    }
}
