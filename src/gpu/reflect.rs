//! Reflection of a SPIR-V module: bindings, push constants, local size and vertex inputs.

use crate::error::{Error, Result};
use ash::vk;
use rspirv::dr::{Instruction, Module, Operand, load_words};
use rspirv::spirv::{BuiltIn, Decoration, Dim, ExecutionMode, Op, StorageClass};
use std::collections::HashMap;

/// One binding of descriptor set 0.
#[derive(Clone, Debug)]
pub struct Binding {
    /// `binding = N`.
    pub index: u32,
    /// Name of the variable, or of its block where the variable has none.
    pub name: String,
    /// Storage or uniform block, texel buffer, image (`texture2D`, or `image2D` of compute shaders), or image with a sampler
    /// (`sampler2D`).
    pub kind: vk::DescriptorType,
    pub writes: bool,
    /// Bytes of the fixed part of the block; 0 for texels and images.
    pub block_bytes: u32,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct VertexInput {
    pub location: u32,
    /// Number of floats, 1 to 4.
    pub components: u32,
}

#[derive(Clone, Debug, Default)]
pub struct Reflection {
    /// Bindings that the module declares, by index.
    pub bindings: Vec<Binding>,
    /// Size of the push-constant block in bytes; 0 without one.
    pub push_bytes: u32,
    /// Memory that the invocations of a workgroup share, bytes.
    pub shared_bytes: u32,
    pub local_size: [u32; 3],
    /// Vertex inputs by location; empty for other stages.
    pub inputs: Vec<VertexInput>,
}

impl Reflection {
    pub fn new(spirv: &[u32]) -> Result<Self> {
        let module =
            load_words(declarations(spirv)).map_err(|error| Error::Failed(format!("unreadable SPIR-V: {error}")))?;
        Reader::new(&module).reflect()
    }
}

/// What stands before the first function, where all declarations are; functions are most of a module.
fn declarations(spirv: &[u32]) -> &[u32] {
    const HEADER_WORDS: usize = 5;
    let mut at = HEADER_WORDS;
    while let Some(word) = spirv.get(at) {
        let [word_count, opcode] = [word >> 16, word & 0xffff];
        if opcode == Op::Function as u32 || word_count == 0 {
            return &spirv[..at];
        }
        at += word_count as usize;
    }
    spirv
}

/// A module with indexes by id, for the queries below.
pub(super) struct Reader<'m> {
    module: &'m Module,
    definitions: HashMap<u32, &'m Instruction>,
    names: HashMap<u32, &'m str>,
    /// What follows a decoration, by the id that carries it and the member of it, if it is a member's.
    decorations: HashMap<(u32, Option<u32>, Decoration), Option<&'m Operand>>,
}

fn id(operand: &Operand) -> u32 {
    match operand {
        Operand::IdRef(id) => *id,
        other => unreachable!("an id was expected, not {other:?}"),
    }
}

fn literal(operand: Option<&Operand>) -> u32 {
    match operand {
        Some(Operand::LiteralBit32(value)) => *value,
        other => unreachable!("a literal was expected, not {other:?}"),
    }
}

impl<'m> Reader<'m> {
    pub(super) fn new(module: &'m Module) -> Self {
        let named = |instruction: &'m Instruction| match (instruction.class.opcode, &instruction.operands[..]) {
            (Op::Name, [target, Operand::LiteralString(name)]) => Some((id(target), name.as_str())),
            _ => None,
        };
        let decorated = |instruction: &'m Instruction| match (instruction.class.opcode, &instruction.operands[..]) {
            (Op::Decorate, [on, Operand::Decoration(kind), rest @ ..]) => Some(((id(on), None, *kind), rest.first())),
            (Op::MemberDecorate, [on, Operand::LiteralBit32(member), Operand::Decoration(kind), rest @ ..]) => {
                Some(((id(on), Some(*member), *kind), rest.first()))
            }
            _ => None,
        };
        let names = module.debug_names.iter().filter_map(named).collect();
        let decorations = module.annotations.iter().filter_map(decorated).collect();
        let definitions =
            module.types_global_values.iter().filter_map(|i| i.result_id.map(|result| (result, i))).collect();
        Reader { module, definitions, names, decorations }
    }

    fn name(&self, target: u32) -> &'m str {
        self.names.get(&target).copied().unwrap_or("")
    }

    /// The number of a decoration that `target` carries, or a member of it.
    fn decoration(&self, target: u32, member: Option<u32>, wanted: Decoration) -> Option<u32> {
        self.decorations.get(&(target, member, wanted)).map(|number| literal(*number))
    }

    fn is_read_only(&self, target: u32, member: Option<u32>) -> bool {
        self.decorations.contains_key(&(target, member, Decoration::NonWritable))
    }

    fn reflect(&self) -> Result<Reflection> {
        let mut out = Reflection { local_size: [1; 3], ..Default::default() };
        for instruction in &self.module.types_global_values {
            let Some(result) = instruction.result_id else { continue };
            if instruction.class.opcode == Op::Variable {
                self.variable(result, instruction, &mut out)?;
            }
            let is_size = instruction.class.opcode == Op::SpecConstantComposite
                && self.decorations.get(&(result, None, Decoration::BuiltIn))
                    == Some(&Some(&Operand::BuiltIn(BuiltIn::WorkgroupSize)));
            if is_size {
                return Err(Error::Failed("the local size must be literal, not a specialisation constant".into()));
            }
        }
        for mode in &self.module.execution_modes {
            if let [_, Operand::ExecutionMode(ExecutionMode::LocalSize), x, y, z] = &mode.operands[..] {
                out.local_size = [literal(Some(x)), literal(Some(y)), literal(Some(z))];
            }
        }
        out.bindings.sort_by_key(|b| b.index);
        out.inputs.sort_by_key(|i| i.location);
        Ok(out)
    }

    fn variable(&self, result: u32, instruction: &Instruction, out: &mut Reflection) -> Result<()> {
        let Operand::StorageClass(class) = instruction.operands[0] else { return Ok(()) };
        let pointer = self.definitions[&instruction.result_type.expect("a variable has a type")];
        let target = id(&pointer.operands[1]);
        match class {
            StorageClass::PushConstant => out.push_bytes = self.size_bytes(target),
            StorageClass::Workgroup => out.shared_bytes += self.size_bytes(target),
            StorageClass::Input => {
                if let Some(location) = self.decoration(result, None, Decoration::Location) {
                    out.inputs.push(VertexInput { location, components: self.components(target) });
                }
            }
            StorageClass::StorageBuffer | StorageClass::Uniform | StorageClass::UniformConstant => {
                out.bindings.push(self.binding(result, target, class)?);
            }
            _ => {}
        }
        Ok(())
    }

    fn binding(&self, variable: u32, target: u32, class: StorageClass) -> Result<Binding> {
        let definition = self.definitions[&target];
        let own_name = self.name(variable);
        let name = if own_name.is_empty() { self.name(target) } else { own_name }.to_owned();
        let set = self.decoration(variable, None, Decoration::DescriptorSet).unwrap_or(0);
        if set != 0 {
            return Err(Error::Failed(format!("{name} is in descriptor set {set}; all bindings are in set 0")));
        }
        let index = self
            .decoration(variable, None, Decoration::Binding)
            .ok_or_else(|| Error::Failed(format!("{name} has no binding number")))?;
        let (kind, writes) = match (class, definition.class.opcode) {
            (StorageClass::StorageBuffer, Op::TypeStruct) => {
                let members = definition.operands.len() as u32;
                let read_only = self.is_read_only(variable, None)
                    || (0..members).all(|member| self.is_read_only(target, Some(member)));
                (vk::DescriptorType::STORAGE_BUFFER, !read_only)
            }
            (StorageClass::Uniform, Op::TypeStruct) => (vk::DescriptorType::UNIFORM_BUFFER, false),
            (StorageClass::UniformConstant, Op::TypeImage) => match definition.operands[1] {
                Operand::Dim(Dim::DimBuffer) => (vk::DescriptorType::UNIFORM_TEXEL_BUFFER, false),
                // Its sixth operand tells whether it is sampled, 1, or stored to, 2.
                Operand::Dim(Dim::Dim2D) if literal(definition.operands.get(5)) == 2 => {
                    (vk::DescriptorType::STORAGE_IMAGE, true)
                }
                Operand::Dim(Dim::Dim2D) => (vk::DescriptorType::SAMPLED_IMAGE, false),
                ref other => return Err(Error::Failed(format!("{name}: images of {other:?} are not in use"))),
            },
            (StorageClass::UniformConstant, Op::TypeSampledImage) => {
                (vk::DescriptorType::COMBINED_IMAGE_SAMPLER, false)
            }
            (class, opcode) => return Err(Error::Failed(format!("{name}: no binding for {class:?} of {opcode:?}"))),
        };
        let block_bytes = if definition.class.opcode == Op::TypeStruct { self.size_bytes(target) } else { 0 };
        Ok(Binding { index, name, kind, writes, block_bytes })
    }

    pub(super) fn components(&self, of: u32) -> u32 {
        match self.definitions[&of].class.opcode {
            Op::TypeVector => literal(self.definitions[&of].operands.get(1)),
            _ => 1,
        }
    }

    /// Bytes of a type; a runtime array counts as 0.
    fn size_bytes(&self, of: u32) -> u32 {
        let definition = self.definitions[&of];
        let operands = &definition.operands;
        match definition.class.opcode {
            Op::TypeInt | Op::TypeFloat => literal(operands.first()) / 8,
            Op::TypeVector | Op::TypeMatrix => literal(operands.get(1)) * self.size_bytes(id(&operands[0])),
            Op::TypeArray => {
                let length = literal(self.definitions[&id(&operands[1])].operands.first());
                let stride = self.decoration(of, None, Decoration::ArrayStride);
                length * stride.unwrap_or_else(|| self.size_bytes(id(&operands[0])))
            }
            Op::TypeStruct => (0..operands.len() as u32)
                .map(|member| {
                    let offset = self.decoration(of, Some(member), Decoration::Offset);
                    offset.unwrap_or(0) + self.size_bytes(id(&operands[member as usize]))
                })
                .max()
                .unwrap_or(0),
            _ => 0,
        }
    }
}
