//! `scripts/expect`: outputs of test runs against lists of expected failures.

use crate::root;
use std::process::{Command, Stdio};

/// Exit code and lines of the script for a list and an output.
fn expect(list: &str, log: &str) -> (i32, Vec<String>) {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in [("list", list), ("log", log)] {
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    let ran = |words: &[&str]| {
        let log = std::fs::File::open(folder.path().join("log")).unwrap();
        let mut command = Command::new(root().join("scripts/expect"));
        command.args(words).current_dir(folder.path()).stdin(Stdio::from(log)).output().unwrap()
    };
    let output = ran(&["list", "log"]);
    let text = String::from_utf8(output.stdout).unwrap();
    assert_eq!(text.as_bytes(), ran(&["list"]).stdout, "a file or standard input");
    (output.status.code().unwrap(), text.lines().map(str::to_owned).collect())
}

const LOG: &str = "\
    Finished `test` profile\n     Running unittests src/lib.rs (target/debug/deps/shadow_fields-1)\n\nrunning 1 test\n\
    test sh::tests::one ... ok\n\ntest result: ok. 1 passed; 0 failed\n\n     Running tests/draw.rs (target/debug/deps/draw-2)\n\n\
    running 4 tests\ntest edges ... FAILED\ntest lines ... ignored, slow\ntest pixels - should panic ... ok\ntest more::edges ... FAILED\n\n\
    failures:\n\n---- edges stdout ----\nnot a line of a test\n\ntest result: FAILED. 1 passed; 2 failed\n\n   Doc-tests shadow_fields\n\n\
    running 1 test\ntest src/lib.rs - (line 3) ... ok\n\ntest result: ok. 1 passed\n";

#[test]
fn a_failure_passes_only_if_it_is_on_the_list() {
    let (code, lines) = expect("", LOG);
    assert_eq!(code, 1);
    assert_eq!(
        lines,
        ["FAILED:   draw::edges", "FAILED:   draw::more::edges", "expect: 5 tests, 0 expected failures, 2 others"]
    );
    let (code, lines) = expect("# driver 7\n\ndraw::edges  # bug 12\n", LOG);
    assert_eq!(
        (code, lines[0].as_str(), lines[1].as_str()),
        (1, "expected: draw::edges (bug 12)", "FAILED:   draw::more::edges")
    );
    let (code, lines) = expect("draw::edges\ndraw::more::edges\n", LOG);
    assert_eq!((code, lines.last().unwrap().as_str()), (0, "expect: 5 tests, 2 expected failures, 0 others"));
    for (list, passes) in [("draw::*edges", true), ("*", true), ("draw::e*", false), ("edges", false), ("*edge", false)]
    {
        assert_eq!(expect(list, LOG).0 == 0, passes, "{list}");
    }
}

#[test]
fn what_no_longer_fails_or_did_not_run_is_told() {
    let (code, lines) = expect("draw::*\ndraw::pixels # mended?\ngone::test\n", LOG);
    assert_eq!(code, 0);
    assert!(lines.contains(&"no longer fails: draw::pixels; take it off list".to_owned()), "{lines:?}");
    assert!(lines.contains(&"did not run: gone::test; take it off list".to_owned()), "{lines:?}");
}

#[test]
fn crashes_and_empty_runs_fail() {
    let crashed = "     Running tests/a/main.rs (target/a-1)\n\nrunning 2 tests\ntest one ... ok\nerror: test failed\n  process didn't exit \
                   successfully (signal: 11, SIGSEGV)\n     Running tests/b.rs (target/b-1)\n\nrunning 1 test\ntest two ... ok\n\ntest result: ok.\n";
    let (code, lines) = expect("", crashed);
    assert_eq!((code, lines[0].as_str()), (1, "FAILED:   a::(ended early)"));
    assert_eq!(expect("a::(ended early) # bug 3\n", crashed).0, 0);
    let last = crashed.replace("\ntest result: ok.\n", "\n");
    assert_eq!(expect("a::*", &last).0, 1, "the last program crashed too");
    assert_eq!(expect("*", "").0, 1, "nothing ran");
    assert_eq!(expect("*", "error: could not compile\n").0, 1, "nothing ran");
    let missing = Command::new(root().join("scripts/expect")).args(["no such list", "/dev/null"]).output().unwrap();
    assert_eq!(missing.status.code(), Some(2));
    let usage = Command::new(root().join("scripts/expect")).output().unwrap();
    assert_eq!(usage.status.code(), Some(2));
}

#[test]
fn tap_is_read_too() {
    let (code, lines) = expect("b*\n", "1..4\nok 1 - a\nnot ok 2 - b [x]\nnot ok 3 c\nok 4 - d # SKIP no device\n");
    assert_eq!((code, &lines[..2]), (1, &["expected: b [x]".to_owned(), "FAILED:   c".to_owned()][..]));
    assert_eq!(lines[2], "expect: 3 tests, 1 expected failures, 1 others");
}
