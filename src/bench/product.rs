//! `bench product`: what a product costs alone, and what it keeps of the truth.

use super::Bench;
use super::figures::{Spread, spread};
use crate::error::Result;
use crate::gpu::{Buffer, BufferKind, Commands};
use crate::merge::chain::{Chain, PRODUCTS, Product};
use crate::merge::product::{ProductShape, Products, Push, twin};
use crate::sh::basis::coefficient_count;
use crate::sh::lobe::{cap, clamped_cosine};
use crate::sh::points;
use crate::sh::product_program::product_program;
use crate::sh::quadrature::random_direction;
use glam::DVec3;
use serde::Serialize;
use serde_json::json;
use std::path::Path;

/// SH bands of all chains.
const BANDS: usize = 4;
/// Products a chain while it is timed.
const STEPS: u32 = 64;

/// One form.
#[derive(Clone, Debug, Serialize)]
pub struct Timed {
    /// Name in the table.
    pub product: &'static str,
    /// Whether chains are guarded.
    pub guard: bool,
    /// SH bands of the factor.
    pub field_bands: usize,
    /// Multiply-adds a product, guard left out.
    pub multiply_adds: usize,
    /// Nanoseconds a product on the whole device, the loop around it taken off.
    pub ns_per_product: Spread,
    /// Multiplications and additions a nanosecond, guard left out.
    pub gflops: f64,
    /// Largest difference to the twin in f64 after one product, in units of the largest coefficient.
    pub error: f64,
    /// Irradiance behind 64 caps of 30 degrees at one place, f64 (truth: 0.77).
    pub identical_64: f64,
}

/// Measures every form on the device.
///
/// # Errors
/// As [`Products::new`]; `Device` when the device was lost.
pub fn measure(bench: &Bench<'_>) -> Result<Vec<Timed>> {
    let (device, library) = (bench.baker.device(), bench.baker.library());
    let chains = Chains::new(bench)?;
    let mut passes = Vec::new();
    for (name, shape) in shapes() {
        let pass = Products::new(device, library, shape, true)?;
        let empty = Products::new(device, library, shape, false)?;
        chains.run(&empty, shape.field_bands, 1)?;
        chains.run(&pass, shape.field_bands, 1)?;
        let found: Vec<f32> = chains.products.download(chains.transfers.len())?;
        let error = error_of(shape, &chains.transfers, &chains.factors[shape.field_bands - BANDS], &found);
        passes.push((name, shape, pass, empty, error, Vec::new()));
        (bench.progress)(&format!("{name}, {} bands, guard {} compiled", shape.field_bands, shape.chain.guard));
    }
    for round in 0..if bench.quick { 6 } else { 16 } {
        for (_, shape, pass, empty, _, times) in &mut passes {
            let took = chains.run(pass, shape.field_bands, STEPS)? - chains.run(empty, shape.field_bands, STEPS)?;
            if round > 0 {
                times.push(took * 1e6 / (f64::from(chains.count) * f64::from(STEPS)));
            }
        }
    }
    Ok(passes.into_iter().map(|(name, shape, _, _, error, times)| timed(name, shape, error, &times)).collect())
}

/// The forms with their names.
fn shapes() -> Vec<(&'static str, ProductShape)> {
    let mut shapes = Vec::new();
    for guard in [false, true] {
        for &(name, product) in PRODUCTS {
            shapes.push((name, ProductShape { chain: Chain { product, guard }, bands: BANDS, field_bands: BANDS }));
        }
    }
    for field_bands in [5, 6, 7] {
        let chain = Chain { product: Product::Matrix, guard: false };
        shapes.push(("matrix", ProductShape { chain, bands: BANDS, field_bands }));
    }
    shapes
}

/// Random transfer vectors, and a cap for each as factors of 4 to 7 bands, here and on the device.
struct Chains<'b> {
    bench: &'b Bench<'b>,
    count: u32,
    transfers: Vec<f64>,
    factors: Vec<Vec<f64>>,
    transfer_buffer: Buffer,
    factor_buffers: Vec<Buffer>,
    products: Buffer,
}

impl<'b> Chains<'b> {
    fn new(bench: &'b Bench<'b>) -> Result<Self> {
        let device = bench.baker.device();
        let count: u32 = if bench.quick { 16_384 } else { 65_536 };
        let mut rng = fastrand::Rng::with_seed(bench.seed);
        let transfers: Vec<f64> = (0..count).flat_map(|_| clamped_cosine(BANDS, random_direction(&mut rng))).collect();
        let mut factors_of = |bands: usize| -> Vec<f64> {
            let cap =
                |rng: &mut fastrand::Rng| cap(bands, random_direction(rng), (5.0 + 30.0 * rng.f64()).to_radians());
            (0..count).flat_map(|_| cap(&mut rng)).collect()
        };
        let factors: Vec<Vec<f64>> = (BANDS..=7).map(&mut factors_of).collect();
        let upload = |name: &str, of: &[f64]| {
            Buffer::with_data(device, name, &of.iter().map(|c| *c as f32).collect::<Vec<f32>>())
        };
        Ok(Chains {
            bench,
            count,
            transfer_buffer: upload("transfers", &transfers)?,
            factor_buffers: factors.iter().map(|f| upload("factors", f)).collect::<Result<_>>()?,
            products: Buffer::new(device, "products", BufferKind::Device, 4 * transfers.len() as u64)?,
            transfers,
            factors,
        })
    }

    /// Device time of so many products a chain, milliseconds.
    fn run(&self, pass: &Products, field_bands: usize, steps: u32) -> Result<f64> {
        let mut commands = Commands::new(self.bench.baker.device(), "product")?;
        let push = Push { count: self.count, steps, fade: 0.97 };
        let buffers = [&self.transfer_buffer, &self.factor_buffers[field_bands - BANDS], &self.products];
        commands.pass("product", |c| pass.record(c, buffers, push))?;
        Ok(commands.submit()?[0].milliseconds)
    }
}

/// What was measured of a form, with its cost and what it makes of 64 identical caps.
fn timed(product: &'static str, shape: ProductShape, error: f64, times: &[f64]) -> Timed {
    let cost = if shape.chain.product.stays_at_points() {
        let mut cost = points::evaluate_program(BANDS).cost();
        cost.fma_count += points::COUNT;
        cost.multiply_count += points::COUNT;
        cost.add_count += points::COUNT;
        cost
    } else {
        let style = shape.chain.product.style(BANDS, shape.field_bands);
        product_program(style, BANDS, shape.field_bands).cost()
    };
    let ns_per_product = spread(times);
    let caps = cap(shape.field_bands, DVec3::new(0.5, 0.75_f64.sqrt(), 0.0), 30_f64.to_radians());
    let start = clamped_cosine(BANDS, DVec3::Y);
    let push = Push { count: 1, steps: 64, fade: 1.0 };
    Timed {
        product,
        guard: shape.chain.guard,
        field_bands: shape.field_bands,
        multiply_adds: cost.fma_count,
        gflops: (cost.multiply_count + cost.add_count) as f64 / ns_per_product.median,
        ns_per_product,
        error,
        identical_64: twin(shape, &start, &caps, push)[0] / start[0],
    }
}

/// Largest difference to the twin among the first chains.
fn error_of(shape: ProductShape, transfers: &[f64], factors: &[f64], found: &[f32]) -> f64 {
    let sizes = [shape.bands, shape.field_bands].map(coefficient_count);
    let chains = transfers.chunks(sizes[0]).zip(factors.chunks(sizes[1])).zip(found.chunks(sizes[0])).take(64);
    let apart = chains.flat_map(|((transfer, factor), found)| {
        let expected = twin(shape, transfer, factor, Push { count: 1, steps: 1, fade: 1.0 });
        found.iter().zip(expected).map(|(f, e)| (f64::from(*f) - e).abs()).collect::<Vec<_>>()
    });
    apart.fold(0.0, |worst, d| if d.is_nan() { f64::INFINITY } else { worst.max(d) })
}

/// Measures, and writes `product.csv` and `product.json` into `folder`.
///
/// # Errors
/// As [`measure`]; `Failed` when the folder cannot be written.
pub fn run(bench: &Bench<'_>, folder: &Path) -> Result<Vec<Timed>> {
    crate::text::make_folder(folder)?;
    let timed = measure(bench)?;
    let origin = json!({ "origin": bench.origin, "quick": bench.quick, "seed": bench.seed });
    crate::text::write_rows(folder, "product", &origin, &timed)?;
    Ok(timed)
}
