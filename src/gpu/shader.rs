//! GLSL to SPIR-V through shaderc at run time, with an include callback and a cache on disk.

use super::compiling;
use super::reflect::Reflection;
use crate::error::{Error, Result};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Mutex, OnceLock, PoisonError};

/// Pipeline stage of a shader, given by the file ending of its entry point.
pub use shaderc::ShaderKind as Stage;

/// Everything that determines the compiled SPIR-V.
pub struct ShaderSource<'a> {
    /// File name, for messages.
    pub name: &'a str,
    pub stage: Stage,
    /// GLSL text of the entry point.
    pub text: String,
    pub defines: &'a [(&'a str, String)],
    /// Whether shaderc inlines functions and unrolls loops, for arithmetic to be counted. Drivers do so in any case: frames
    /// are as fast, and the first picture comes a fifth sooner.
    pub optimised: bool,
    /// Text of an included file by the name in the `#include` line.
    pub include: &'a dyn Fn(&str) -> Option<String>,
}

/// Compiled code and its reflection.
#[derive(Clone, Debug)]
pub struct Shader {
    pub name: String,
    pub stage: Stage,
    /// SPIR-V 1.5 words.
    pub spirv: Vec<u32>,
    pub reflection: Reflection,
}

impl Shader {
    /// Compiles `source`, or reads the words from `cache_dir` if the same source, includes and defines were compiled by
    /// the same compiler before. The process keeps what it compiles or reads: one frame or bake after another asks for the
    /// same.
    pub fn compile(source: &ShaderSource<'_>, cache_dir: Option<&Path>) -> Result<Self> {
        static COMPILED: Mutex<BTreeMap<String, Shader>> = Mutex::new(BTreeMap::new());
        let compiled = || COMPILED.lock().unwrap_or_else(PoisonError::into_inner);
        let includes = gather(source.name, &source.text, source.include)?;
        let key = key(source, &includes);
        if let Some(shader) = compiled().get(&key) {
            return Ok(shader.clone());
        }
        let shader = Self::cached(source, &includes, &key, cache_dir)?;
        compiled().insert(key, shader.clone());
        Ok(shader)
    }

    fn cached(
        source: &ShaderSource<'_>,
        includes: &BTreeMap<String, String>,
        key: &str,
        cache_dir: Option<&Path>,
    ) -> Result<Self> {
        let path = cache_dir.map(|folder| folder.join("spirv").join(format!("{key}.spv")));
        let file = path.as_ref().and_then(|path| crate::files::read(path).ok()).unwrap_or_default();
        let cached = unsealed(key, &file).filter(|bytes| bytes.len() % 4 == 0);
        let cached = cached.map(|bytes| bytes.chunks_exact(4).map(bytemuck::pod_read_unaligned).collect());
        let shader = |spirv: Vec<u32>| -> Result<Self> {
            let reflection = Reflection::new(&spirv).map_err(|error| error.context(source.name))?;
            Ok(Shader { name: source.name.to_owned(), stage: source.stage, spirv, reflection })
        };
        // A cache entry that reflection cannot read is damaged: the shader is compiled again.
        if let Some(found) = cached.and_then(|spirv| shader(spirv).ok()) {
            return Ok(found);
        }
        compiling::begins(source.name);
        let spirv = compile(source, includes)?;
        if let Some(path) = path
            && let Err(error) = crate::files::replace(&path, &sealed(key, bytemuck::cast_slice(&spirv)))
        {
            log::warn!("{}: the compiled shader was not saved: {error}", path.display());
        }
        shader(spirv)
    }
}

/// Every file that a text includes, directly or indirectly, by name; `include` gives the text of one.
fn gather(name: &str, text: &str, include: &dyn Fn(&str) -> Option<String>) -> Result<BTreeMap<String, String>> {
    let mut found = BTreeMap::new();
    // Texts that are still to be read, and by which chain of files each was included.
    let mut open = vec![(name.to_owned(), text.to_owned())];
    while let Some((chain, text)) = open.pop() {
        let names = text.lines().filter_map(|line| line.trim_start().strip_prefix("#include"));
        for name in names.map(|name| name.trim().trim_matches('"')) {
            if found.contains_key(name) {
                continue;
            }
            let included =
                include(name).ok_or_else(|| Error::Failed(format!("{chain}: there is no \"{name}\" to include")))?;
            found.insert(name.to_owned(), included.clone());
            open.push((format!("{chain} > {name}"), included));
        }
    }
    Ok(found)
}

/// Hash of all that changes the outcome: texts, defines, stage, compiler version and the options in [`compile`].
fn key(source: &ShaderSource<'_>, includes: &BTreeMap<String, String>) -> String {
    static COMPILER: OnceLock<(u32, u32)> = OnceLock::new();
    let mut hasher = blake3::Hasher::new();
    let mut part = |text: &str| {
        hasher.update(&(text.len() as u64).to_le_bytes());
        hasher.update(text.as_bytes());
    };
    part(&format!(
        "{:?} {:?} {} vulkan1.3 spirv1.5",
        COMPILER.get_or_init(shaderc::get_spirv_version),
        source.stage,
        source.optimised
    ));
    part(env!("CARGO_PKG_VERSION"));
    part(&source.text);
    for (name, value) in source.defines {
        part(name);
        part(value);
    }
    for (name, text) in includes {
        part(name);
        part(text);
    }
    hasher.finalize().to_hex()[..32].to_owned()
}

fn compile(source: &ShaderSource<'_>, includes: &BTreeMap<String, String>) -> Result<Vec<u32>> {
    let missing = |error: shaderc::Error| Error::Failed(format!("{}: no shader compiler: {error}", source.name));
    let compiler = shaderc::Compiler::new().map_err(missing)?;
    let mut options = shaderc::CompileOptions::new().map_err(missing)?;
    options.set_target_env(shaderc::TargetEnv::Vulkan, shaderc::EnvVersion::Vulkan1_3 as u32);
    // 1.5: in 1.6 the local size becomes an id (ExecutionModeId), which the reader in rspirv 0.13 refuses.
    options.set_target_spirv(shaderc::SpirvVersion::V1_5);
    if source.optimised {
        options.set_optimization_level(shaderc::OptimizationLevel::Performance);
        options.set_generate_debug_info(); // without it names are lost, which reflection needs
    }
    options.set_warnings_as_errors();
    for (name, value) in source.defines {
        options.add_macro_definition(name, Some(value));
    }
    options.set_include_callback(|name, _, from, _| {
        let content =
            includes.get(name).cloned().ok_or_else(|| format!("{from}: there is no \"{name}\" to include"))?;
        Ok(shaderc::ResolvedInclude { resolved_name: name.to_owned(), content })
    });
    let artifact = compiler
        .compile_into_spirv(&source.text, source.stage, source.name, "main", Some(&options))
        .map_err(|error| Error::Shader(format!("{}: {error}", source.name)))?;
    Ok(artifact.as_binary().to_vec())
}

/// Content of a cache file: a hash of the key and the data, then the data. Neither a damaged file nor one that was
/// copied over another reaches a driver. All keys of a kind of file have the same length, so that no other key and data
/// give the same hash.
pub fn sealed(key: &str, data: &[u8]) -> Vec<u8> {
    let mut file = hash(key, data).as_bytes().to_vec();
    file.extend_from_slice(data);
    file
}

/// The data of a cache file; `None` if it was not sealed with this key.
pub(super) fn unsealed<'f>(key: &str, file: &'f [u8]) -> Option<&'f [u8]> {
    let (seal, data) = file.split_at_checked(blake3::OUT_LEN)?;
    (hash(key, data).as_bytes() == seal).then_some(data)
}

fn hash(key: &str, data: &[u8]) -> blake3::Hash {
    blake3::Hasher::new().update(key.as_bytes()).update(data).finalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "#version 460\n#include \"a.glsl\"\nlayout(local_size_x = 8) in;\n\
        layout(std430, binding = 0) buffer Out { float values[]; };\nvoid main() { values[0] = A + float(B); }\n";

    fn source<'a>(include: &'a dyn Fn(&str) -> Option<String>, defines: &'a [(&'a str, String)]) -> ShaderSource<'a> {
        ShaderSource { name: "test.comp", stage: Stage::Compute, text: TEXT.into(), defines, optimised: false, include }
    }

    /// As another process finds it.
    fn from_disk(source: &ShaderSource<'_>, folder: &Path) -> Vec<u32> {
        let includes = gather(source.name, &source.text, source.include).unwrap();
        Shader::cached(source, &includes, &key(source, &includes), Some(folder)).unwrap().spirv
    }

    #[test]
    fn cache_key_sees_includes_and_defines_and_damage_is_compiled_anew() {
        let folder = tempfile::tempdir().unwrap();
        let one = |name: &str| (name == "a.glsl").then(|| "const float A = 1.0;\n".to_owned());
        let two = |name: &str| (name == "a.glsl").then(|| "const float A = 2.0;\n".to_owned());
        let b = |value: &str| vec![("B", value.to_owned())];
        let compile = |include: &dyn Fn(&str) -> Option<String>, defines: &[(&str, String)]| {
            from_disk(&source(include, defines), folder.path())
        };
        let first = compile(&one, &b("3"));
        let files =
            || std::fs::read_dir(folder.path().join("spirv")).unwrap().map(|f| f.unwrap().path()).collect::<Vec<_>>();
        assert_eq!(files().len(), 1);
        assert_eq!(compile(&one, &b("3")), first);
        assert_eq!(files().len(), 1, "the same source is found again");
        assert_ne!(compile(&two, &b("3")), first);
        assert_ne!(compile(&one, &b("4")), first);
        assert_eq!(files().len(), 3);
        for file in files() {
            let mut bytes = std::fs::read(&file).unwrap();
            let last = bytes.len() - 1;
            bytes[last] ^= 1;
            std::fs::write(&file, bytes).unwrap();
        }
        assert_eq!(compile(&one, &b("3")), first, "a damaged entry is not used");
    }

    #[test]
    fn cache_files_that_were_swapped_are_compiled_anew_and_healed() {
        let folder = tempfile::tempdir().unwrap();
        let include = |_: &str| Some("const float A = 1.0;\n".to_owned());
        let compile = |value: &str| {
            let defines = [("B", value.to_owned())];
            from_disk(&source(&include, &defines), folder.path())
        };
        let compiled = ["3", "4"].map(compile);
        assert_ne!(compiled[0], compiled[1]);
        let files = std::fs::read_dir(folder.path().join("spirv")).unwrap().map(|file| file.unwrap().path());
        let [one, two] = files.collect::<Vec<_>>().try_into().unwrap();
        let read = || [&one, &two].map(|path| std::fs::read(path).unwrap());
        let good = read();
        std::fs::write(&one, &good[1]).unwrap();
        std::fs::write(&two, &good[0]).unwrap();
        assert_eq!(["3", "4"].map(compile), compiled, "a swapped entry is not used");
        assert_eq!(read(), good, "it is replaced");
    }

    #[test]
    fn missing_include_names_its_chain() {
        let include = |name: &str| (name == "a.glsl").then(|| "#include \"gone.glsl\"\n".to_owned());
        let error = Shader::compile(&source(&include, &[]), None).unwrap_err().to_string();
        assert!(error.contains("test.comp > a.glsl") && error.contains("gone.glsl"), "{error}");
    }

    #[test]
    fn compile_errors_carry_file_and_line() {
        let include = |_: &str| Some("const float A = nonsense;\n".to_owned());
        let error = Shader::compile(&source(&include, &[("B", "1".into())]), None).unwrap_err().to_string();
        assert!(error.contains("a.glsl:1") && error.contains("nonsense"), "{error}");
    }
}
