//! Plans of farms and results of slices, as any machine may find them in a shared folder.

use super::targets::{NAME, bordered, sealed, with_file};
use shadow_fields::Result;
use shadow_fields::bake::kinds::Kind;
use shadow_fields::error::Error;
use shadow_fields::farm::engines::{self, Call};
use shadow_fields::farm::plan::{DeviceClass, Input, Plan, Task, TaskCost, TaskKind, Work};
use shadow_fields::farm::results::{self, Content, SliceResult};
use shadow_fields::farm::status::{Status, missing};
use std::path::{Path, PathBuf};

pub const TOKENS: &[&str] = &[
    "\"works\":[",
    "\"tasks\":[",
    "\"slices\":[",
    "\"pictures\":\"#.png\"",
    "\"frames\"",
    "{\"bake\":\"silhouette\"}",
    "\"seconds\":",
    "4294967295",
    "1e38",
    "-1",
    "null",
    "[",
    "]",
    ",",
];

fn example() -> Plan {
    let device = DeviceClass { name: "none".into(), driver: "none".into() };
    let mut plan = Plan::new(device, "results".into());
    let words = vec!["--quality".into(), "draft".into()];
    plan.works = vec![Work { words: words.clone(), pictures: None }, Work { words, pictures: Some("f_#.png".into()) }];
    plan.inputs.push(Input { path: "m.obj".into(), hash: "00".into() });
    let cost = TaskCost { seconds: 50.0, memory_mb: 1.0, bytes: 1e6 };
    let task = |first| Task { work: 0, input: 0, kind: TaskKind::Bake(Kind::Shadow), first, count: 3 };
    (0..3).for_each(|part| plan.add(task(part), cost));
    plan.add(Task { work: 1, input: 0, kind: TaskKind::Frames, first: 5, count: 7 }, cost);
    plan
}

pub fn plans() -> Vec<Vec<u8>> {
    vec![with_file(&[], |path| {
        example().write(path).unwrap();
        std::fs::read(path).unwrap()
    })]
}

/// What is read goes to all engines.
pub fn plan(bytes: &[u8]) -> Result<()> {
    let path = Path::new(NAME);
    let plan = Plan::parse(bytes, path)?;
    let slices = missing(&plan);
    let call = Call { program: "p".into(), plan: path.to_owned(), words: Vec::new() };
    let said = engines::slurm(&plan, &call, Path::new("logs")).len() + Status::of(&plan).line(8).len();
    assert!(said > 0 && engines::openjd(&plan, &call, &slices).is_object());
    assert!(slices.is_empty() || !engines::arrays(&slices, Some(2)).is_empty());
    Ok(())
}

/// A plan whose results lie beside the file of inputs, and the result of its first slice. Naming that takes as long as reading it.
fn with_plan<R>(run: impl FnOnce(&Plan, &Path) -> R) -> R {
    thread_local! {
        static PLAN: (Plan, PathBuf) = {
            let mut plan = example();
            plan.folder = with_file(&[], |path| path.parent().unwrap().to_owned());
            let path = results::path(&plan, 0);
            (plan, path)
        };
    }
    PLAN.with(|(plan, path)| run(plan, path))
}

pub fn slices() -> Vec<Vec<u8>> {
    with_plan(|plan, path| {
        let mut content = Content::default();
        content.add(0, "a.sf", &[7; 20]);
        content.add(1, "part", &[]);
        content.write(plan, 0, 2.5).unwrap();
        vec![bordered(std::fs::read(path).unwrap())]
    })
}

pub fn slice(bytes: &[u8]) -> Result<()> {
    with_plan(|plan, path| {
        std::fs::write(path, sealed(bytes)).unwrap();
        assert!(Status::of(plan).line(8).contains("1 of 2 slices"));
        match results::find(plan, 0) {
            SliceResult::Whole(about, entries) => {
                assert!(about.key == plan.key(0) && entries.iter().all(|(task, ..)| *task < 2));
                Ok(())
            }
            SliceResult::Damaged(error) => Err(error),
            SliceResult::Missing => Err(Error::Failed("it is there, and not found".into())),
        }
    })
}
