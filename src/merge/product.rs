//! Pass "product": chains of products alone, for measuring and testing what is inside the merge.
//!
//! MergeInputs: `transfers`, the coefficients of a chain an invocation; `factors`, a blocked part each. Output: `products`, the chain's
//! coefficients after a number of multiplications by 1 - b, where b fades by a factor each step.

use crate::error::Result;
use crate::gpu::{Bind, Buffer, Commands, ComputePipeline, Device};
use crate::merge::chain::{Chain, Multiplier};
use crate::sh::basis::{MAX_COEFFICIENTS, Y00, coefficient_count};
use crate::sh::product_program::STYLES;
use crate::shaders::{Library, ShaderPermutation};
use bytemuck::{Pod, Zeroable};
use std::sync::Arc;

const WORKGROUP: u32 = 64;

/// Which product, of what.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProductShape {
    /// How it is done.
    pub chain: Chain,
    /// SH bands of the chain.
    pub bands: usize,
    /// SH bands of the factors.
    pub field_bands: usize,
}

/// How often each chain is multiplied.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Push {
    /// Chains.
    pub count: u32,
    /// Multiplications of each, at least 1.
    pub steps: u32,
    /// What b is multiplied by after each.
    pub fade: f32,
}

/// The pipeline.
pub struct Products {
    pipeline: ComputePipeline,
}

impl Products {
    /// The row of the shader table; without `multiply`, the loop alone.
    pub fn row(shape: ProductShape, multiply: bool) -> ShaderPermutation {
        let style = shape.chain.product.style(shape.bands, shape.field_bands);
        ShaderPermutation::new("product.comp", shape.bands)
            .field_bands(shape.field_bands)
            .define("WORKGROUP", WORKGROUP)
            .define("PRODUCT", STYLES.iter().position(|s| *s == style).expect("every style is listed") as u32)
            .define("POINT_CHAIN", shape.chain.product.stays_at_points())
            .define("GUARD", shape.chain.guard)
            .number("Y00", Y00)
            .define("MULTIPLY", multiply)
    }

    /// The pipeline of a shape.
    ///
    /// # Errors
    /// `Failed` when the shader does not compile: products at points want transfer and factors of the same bands, at most
    /// [`crate::sh::points::BANDS`].
    pub fn new(device: &Arc<Device>, library: &Library, shape: ProductShape, multiply: bool) -> Result<Self> {
        let shader = library.shader(&Self::row(shape, multiply))?;
        Ok(Products { pipeline: ComputePipeline::new(device, "product", &shader, &[])? })
    }

    /// Multiplies `push.count` chains.
    ///
    /// # Errors
    /// `Input` when a buffer is larger than the device can bind.
    pub fn record<'r>(
        &'r self,
        commands: &mut Commands<'r>,
        [transfers, factors, products]: [&'r Buffer; 3],
        push: Push,
    ) -> Result<()> {
        let resources = [Bind::Buffer(transfers), Bind::Buffer(factors), Bind::Buffer(products)];
        commands.dispatch(&self.pipeline, &resources, &push, [push.count, 1, 1])
    }
}

/// The CPU twin of one chain.
pub fn twin(shape: ProductShape, transfer: &[f64], factor: &[f64], push: Push) -> Vec<f64> {
    let multiplier = Multiplier::new(shape.chain, shape.bands, shape.field_bands);
    let mut state = multiplier.begin(transfer);
    let mut blocked = [0.0; MAX_COEFFICIENTS];
    blocked[..factor.len()].copy_from_slice(factor);
    for _ in 0..push.steps {
        multiplier.multiply(&mut state, &blocked);
        blocked.iter_mut().for_each(|b| *b *= f64::from(push.fade));
    }
    let unit = |k: usize| {
        let mut unit = vec![0.0; coefficient_count(shape.bands)];
        unit[k] = 1.0;
        unit
    };
    (0..coefficient_count(shape.bands)).map(|k| multiplier.meet(&state, &unit(k))).collect()
}
