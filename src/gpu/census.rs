//! Counts the operations of one iteration of a shader's main loop in its SPIR-V.

use super::reflect::Reader;
use super::shader::Shader;
use crate::error::{Error, Result};
use rspirv::dr::{Block, Instruction, Module, Operand};
use rspirv::spirv::{Op, StorageClass};
use std::collections::{BTreeMap, BTreeSet, HashMap};

/// `Fma` of the extended instruction set GLSL.std.450.
const FMA: u32 = 50;

/// Counts for one iteration of the longest loop, or for the whole shader if it has no loop. The code is not executed:
/// both sides of a branch count, which is what they cost on devices that mask lanes.
#[derive(Clone, Debug, Default)]
pub struct Census {
    /// Additions, subtractions and multiplications of floats, component by component.
    pub flops: u32,
    /// Texels fetched, and samples taken by a sampler, by the binding's name.
    pub fetches: BTreeMap<String, u32>,
    /// Bytes loaded from storage and uniform blocks.
    pub block_bytes: u32,
}

impl Census {
    pub fn new(shader: &Shader) -> Result<Self> {
        let module = rspirv::dr::load_words(&shader.spirv)
            .map_err(|error| Error::Failed(format!("{}: unreadable SPIR-V: {error}", shader.name)))?;
        let blocks: Vec<&Block> = module.functions.iter().flat_map(|f| &f.blocks).collect();
        let counter = Counter::new(&module, &blocks);
        let longest = loops(&blocks).into_iter().max_by_key(Vec::len).unwrap_or_else(|| blocks.clone());
        let mut census = Census::default();
        longest.iter().flat_map(|block| &block.instructions).for_each(|i| counter.count(i, &mut census));
        Ok(census)
    }

    pub fn fetch_count(&self) -> u32 {
        self.fetches.values().sum()
    }
}

fn label(block: &Block) -> u32 {
    block.label.as_ref().and_then(|l| l.result_id).unwrap_or(0)
}

fn ids(instruction: &Instruction) -> impl Iterator<Item = u32> {
    instruction.operands.iter().filter_map(|operand| match operand {
        Operand::IdRef(id) => Some(*id),
        _ => None,
    })
}

/// The blocks of every loop: those that are reached from its header without passing its merge block.
fn loops<'m>(blocks: &[&'m Block]) -> Vec<Vec<&'m Block>> {
    let by_label: HashMap<u32, &Block> = blocks.iter().map(|&block| (label(block), block)).collect();
    let body = |header: &&'m Block| {
        let merge = header.instructions.iter().find(|i| i.class.opcode == Op::LoopMerge)?;
        let end = ids(merge).next()?;
        let mut seen = BTreeSet::from([end]);
        let mut open = vec![label(header)];
        let mut body = Vec::new();
        while let Some(next) = open.pop() {
            if let (true, Some(&block)) = (seen.insert(next), by_label.get(&next)) {
                body.push(block);
                open.extend(block.instructions.last().into_iter().flat_map(ids).filter(|id| by_label.contains_key(id)));
            }
        }
        Some(body)
    };
    blocks.iter().filter_map(body).collect()
}

struct Counter<'m> {
    reader: Reader<'m>,
    types: HashMap<u32, &'m Instruction>,
    /// Result of a load or an access chain to the variable at its root.
    roots: HashMap<u32, u32>,
}

impl<'m> Counter<'m> {
    fn new(module: &'m Module, blocks: &[&'m Block]) -> Self {
        let types: HashMap<u32, &Instruction> =
            module.types_global_values.iter().filter_map(|i| Some((i.result_id?, i))).collect();
        let mut roots: HashMap<u32, u32> =
            types.iter().filter(|(_, i)| i.class.opcode == Op::Variable).map(|(&id, _)| (id, id)).collect();
        for instruction in blocks.iter().flat_map(|block| &block.instructions) {
            if matches!(instruction.class.opcode, Op::Load | Op::AccessChain | Op::InBoundsAccessChain | Op::Image)
                && let (Some(result), Some(base)) = (instruction.result_id, ids(instruction).next())
                && let Some(&root) = roots.get(&base)
            {
                roots.insert(result, root);
            }
        }
        Counter { reader: Reader::new(module), types, roots }
    }

    fn count(&self, instruction: &Instruction, census: &mut Census) {
        let components = || instruction.result_type.map_or(1, |ty| self.reader.components(ty));
        match instruction.class.opcode {
            Op::FAdd | Op::FSub | Op::FMul | Op::VectorTimesScalar => census.flops += components(),
            Op::Dot => {
                // Only vectors of three are dotted: three multiplications and two additions.
                census.flops += 5;
            }
            // The optimiser emits Fma for `x * y + z`, whether or not the device fuses it.
            Op::ExtInst if instruction.operands.get(1) == Some(&Operand::LiteralExtInstInteger(FMA)) => {
                census.flops += 2 * components();
            }
            Op::ImageFetch | Op::ImageSampleExplicitLod => {
                let root = ids(instruction).next().and_then(|image| self.roots.get(&image));
                let name = root.map_or_else(String::new, |&root| self.reader.variable_name(root));
                *census.fetches.entry(name).or_default() += 1;
            }
            Op::Load => {
                let Some(root) = ids(instruction).next().and_then(|id| self.roots.get(&id)) else { return };
                let class = self.types.get(root).map(|variable| &variable.operands[0]);
                let block =
                    matches!(class, Some(Operand::StorageClass(StorageClass::StorageBuffer | StorageClass::Uniform)));
                if let (true, Some(ty)) = (block, instruction.result_type) {
                    census.block_bytes += self.reader.size_bytes(ty);
                }
            }
            _ => {}
        }
    }
}
