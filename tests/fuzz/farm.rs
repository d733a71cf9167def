//! Plans of farms and results of slices, as any machine may find them in a shared folder.

use super::common;
use super::targets::{NAME, framed, unframed, with_file};
use shadow_fields::farm::Plan;
use shadow_fields::farm::engines::{self, Call};
use shadow_fields::farm::results::{self, SliceResult, missing};
use shadow_fields::{Error, Result};
use std::path::{Path, PathBuf};

pub const TOKENS: &str = "\
    \"films\":[|\"meshes\":[|\"slices\":[|\"pictures\":\"#.png\"|{\"meshes\":{\"first\":0,\"count\":1}}|\
    4294967295|4294967290|-1|null|[|]|,";

pub fn plans() -> Vec<Vec<u8>> {
    vec![with_file(&[], |path| {
        common::plan().write(path).unwrap();
        std::fs::read(path).unwrap()
    })]
}

/// What is read goes to all engines.
pub fn plan(bytes: &[u8]) -> Result<()> {
    let path = Path::new(NAME);
    let plan = Plan::parse(bytes, path)?;
    let slices = missing(&plan);
    let call = Call::new(Path::new("p"), path, Vec::new()).unwrap();
    assert!(!engines::slurm(&call).is_empty() && engines::openjd(&call, &slices).is_ok());
    Ok(())
}

/// A plan whose results lie beside the inputs, and the path of its first: naming takes as long as reading.
fn with_plan<R>(run: impl FnOnce(&Plan, &Path) -> R) -> R {
    thread_local! {
        static PLAN: (Plan, PathBuf) = {
            let mut plan = common::plan();
            plan.folder = with_file(&[], |path| path.parent().unwrap().to_owned());
            let path = results::path(&plan, 0);
            (plan, path)
        };
    }
    PLAN.with(|(plan, path)| run(plan, path))
}

pub fn slices() -> Vec<Vec<u8>> {
    with_plan(|plan, path| {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("a.sf"), [7; 20]).unwrap();
        std::fs::write(folder.path().join("b"), []).unwrap();
        results::write(plan, 0, folder.path(), 2).unwrap();
        vec![unframed(&std::fs::read(path).unwrap())]
    })
}

pub fn slice(bytes: &[u8]) -> Result<()> {
    with_plan(|plan, path| {
        std::fs::write(path, framed(bytes, *b"SHSLICE\n")).unwrap();
        assert_eq!(missing(plan), [1, 2, 3]);
        match results::find(plan, 0) {
            SliceResult::Whole(files) => {
                assert!(files.iter().all(|(name, _)| !name.contains('/') && !name.starts_with('.')));
                Ok(())
            }
            SliceResult::Damaged(error) => Err(error),
            SliceResult::Missing => Err(Error::Failed("it is there, and not found".into())),
        }
    })
}
