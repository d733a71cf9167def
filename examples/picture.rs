//! A scene made in code, lit and drawn into a PNG: `cargo run --example picture -- picture.png`.

use shadow_fields::asset::environment::EnvironmentData;
use shadow_fields::prelude::*;

fn main() -> Result<(), Error> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "picture.png".into());
    let scene = Scene::builder()
        .camera(Camera::new([0.0, 2.2, 4.5], [0.0, 0.4, 0.0]))
        .environment(EnvironmentData { uniform: Some([0.15, 0.18, 0.25].into()), ..Default::default() })
        .mesh("floor", Generator::Plane { size_m: 6.0, cells: 64 })
        .mesh("ring", Generator::Torus { major_m: 0.5, minor_m: 0.18, segments: 64, sides: 32 })
        .mesh("lamp", Generator::Sphere { radius_m: 0.12, subdivisions: 3 })
        .entity(EntityData::of_mesh("floor"))
        .entity(EntityData {
            position: [0.0, 0.7, 0.0].into(),
            albedo: [0.8, 0.4, 0.2].into(),
            ..EntityData::of_mesh("ring")
        })
        .entity(EntityData {
            position: [1.2, 1.8, 0.6].into(),
            emission: [60.0, 54.0, 44.0].into(),
            ..EntityData::of_mesh("lamp")
        })
        .build()?;
    let gpu = Gpu::own(&DeviceOptions { cache_dir: Cache::usual_folder(), ..Default::default() })?;
    let options = RenderOptions { bake: Quality::Draft.into(), size: Some([480, 320]), ..Default::default() };
    Renderer::new(&gpu, &scene, &options)?.write_png(path.as_ref())?;
    println!("{path}: {} on {}", scene.entities.len(), gpu.device().info.name);
    Ok(())
}
