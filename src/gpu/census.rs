//! Counts the arithmetic of one iteration of a shader's main loop in its SPIR-V.

use super::reflect::Reader;
use super::shader::Shader;
use crate::error::{Error, Result};
use rspirv::dr::{Block, Instruction, Operand};
use rspirv::spirv::Op;
use std::collections::{BTreeSet, HashMap};

/// `Fma` of the extended instruction set GLSL.std.450.
const FMA: u32 = 50;

/// Additions, subtractions and multiplications of floats, component by component, in one iteration of the longest loop,
/// or in the whole shader if it has no loop. The code is not executed: both sides of a branch count, which is what they
/// cost on devices that mask lanes.
pub fn flops(shader: &Shader) -> Result<u32> {
    let module = rspirv::dr::load_words(&shader.spirv)
        .map_err(|error| Error::Failed(format!("{}: unreadable SPIR-V: {error}", shader.name)))?;
    let reader = Reader::new(&module);
    let blocks: Vec<&Block> = module.functions.iter().flat_map(|f| &f.blocks).collect();
    let longest = loops(&blocks).into_iter().max_by_key(Vec::len).unwrap_or_else(|| blocks.clone());
    let of = |instruction: &Instruction| {
        let components = || instruction.result_type.map_or(1, |ty| reader.components(ty));
        match instruction.class.opcode {
            Op::FAdd | Op::FSub | Op::FMul | Op::VectorTimesScalar => components(),
            // Only vectors of three are dotted: three multiplications and two additions.
            Op::Dot => 5,
            // The optimiser emits Fma for `x * y + z`, whether or not the device fuses it.
            Op::ExtInst if instruction.operands.get(1) == Some(&Operand::LiteralExtInstInteger(FMA)) => {
                2 * components()
            }
            _ => 0,
        }
    };
    Ok(longest.iter().flat_map(|block| &block.instructions).map(of).sum())
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
