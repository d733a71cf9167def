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

const CRASHED: &str = "\
    \x20    Running tests/a/main.rs (target/a-1)\n\nrunning 2 tests\ntest one ... ok\nerror: test failed\n  process \
    didn't exit successfully (signal: 11, SIGSEGV)\n     Running tests/b.rs (target/b-1)\n\nrunning 1 test\n\
    test two ... ok\n\ntest result: ok.\n";

const TAP: &str = "1..4\nok 1 - a\nnot ok 2 - b [x]\nnot ok 3 c\nok 4 - d # SKIP no device\n";

/// Only listed failures pass; what is mended or did not run is told; crashes and empty runs fail; TAP is read too.
#[test]
fn lists_and_outputs_of_every_kind() {
    let last = CRASHED.replace("\ntest result: ok.\n", "\n");
    let two =
        ["FAILED:   draw::edges", "FAILED:   draw::more::edges", "expect: 5 tests, 0 expected failures, 2 others"];
    let mended = ["no longer fails: draw::pixels; take it off list", "did not run: gone::test; take it off list"];
    let tap = ["expected: b [x]", "FAILED:   c", "expect: 3 tests, 1 expected failures, 1 others"];
    for (list, log, code, lines) in [
        ("", LOG, 1, &two[..]),
        ("# driver 7\n\ndraw::edges  # bug 12\n", LOG, 1, &["expected: draw::edges (bug 12)", two[1]]),
        ("draw::edges\ndraw::more::edges\n", LOG, 0, &["expect: 5 tests, 2 expected failures, 0 others"]),
        ("draw::*edges", LOG, 0, &[]),
        ("*", LOG, 0, &[]),
        ("draw::e*", LOG, 1, &[]),
        ("edges", LOG, 1, &[]),
        ("*edge", LOG, 1, &[]),
        ("draw::*\ndraw::pixels # mended?\ngone::test\n", LOG, 0, &mended),
        ("", CRASHED, 1, &["FAILED:   a::(ended early)"]),
        ("a::(ended early) # bug 3\n", CRASHED, 0, &[]),
        // The last program crashed too.
        ("a::*", &last, 1, &[]),
        // Nothing ran.
        ("*", "", 1, &[]),
        ("*", "error: could not compile\n", 1, &[]),
        ("b*\n", TAP, 1, &tap),
    ] {
        let (found, said) = expect(list, log);
        let is_said = lines.iter().all(|line| said.iter().any(|said| said == line));
        assert!(found == code && is_said, "{list}: {found} {said:?}");
    }
    for words in [&["no such list", "/dev/null"][..], &[]] {
        let missing = Command::new(root().join("scripts/expect")).args(words).output().unwrap();
        assert_eq!(missing.status.code(), Some(2), "{words:?}");
    }
}
