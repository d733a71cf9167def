//! Every parser and decoder on mutated inputs: none panics, takes a second or a gigabyte, or says more than one line.
//!
//! What a parser says guides the mutation: an input that is refused in new words, or read, becomes one from which
//! others are made. The stable toolchain reports no coverage to a test. Longer, in a release build: `scripts/fuzz
//! SECONDS [TARGET]`.

#[path = "../common/mod.rs"]
mod common;
mod farm;
mod memory;
mod mutate;
mod stored;
mod targets;

use common::report;
use fastrand::Rng;
use std::collections::HashSet;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::time::{Duration, Instant};
use targets::{NAME, TARGETS, Target};

#[global_allocator]
static MEMORY: memory::Counting = memory::Counting;

/// Longest processor time that an input may take; a build for tests is slower. What is made of it takes time too, as a
/// short scene may ask for a sphere of a million triangles: so much is added for every [`TIMED_BYTES`] of memory.
const MOST_TIME: Duration = Duration::from_secs(if cfg!(debug_assertions) { 8 } else { 1 });
/// Bytes that may take as long as a parser: a sphere of 1.3 million triangles takes 0.7 to 1.2 s and as many bytes.
const TIMED_BYTES: usize = 1 << 28;
const MOST_BYTES: usize = 1 << 30;
/// Seconds for all targets where nobody says how many.
const SECONDS: f64 = 12.0;
/// Inputs from which others are made; older ones make room.
const MOST_SEEDS: usize = 4096;

/// What the inputs of one target came to.
#[derive(Default)]
struct Tally {
    executions: u64,
    read: u64,
    slowest: Duration,
    largest: usize,
}

/// Between these a parser quotes its input; between double quotes there may be more of them.
const QUOTES: [[&str; 2]; 5] = [
    ["\"", "\""],
    ["'", "'"],
    ["unknown field `", "`, expected"],
    ["unknown variant `", "`, expected"],
    ["a plan of ", ", and this is"],
];

/// The words of an outcome's first line without its numbers and what it quotes.
fn signature(outcome: &shadow_fields::Result<()>) -> String {
    let Err(error) = outcome else { return String::new() };
    let mut text = error.to_string();
    text.truncate(text.find('\n').unwrap_or(text.len()));
    for [before, behind] in QUOTES {
        if let Some(from) = text.find(before).map(|at| at + before.len())
            && let Some(length) = if behind == "\"" { text[from..].rfind(behind) } else { text[from..].find(behind) }
        {
            text.replace_range(from..from + length, "");
        }
    }
    text.chars().filter(|c| c.is_ascii_alphabetic() || *c == ' ').take(90).collect()
}

impl Target {
    /// Tries one input. Answers with what the parser said.
    fn run(&self, input: &[u8], tally: &mut Tally) -> String {
        let start = memory::processor_time();
        let (outcome, bytes) = memory::measured(|| catch_unwind(AssertUnwindSafe(|| (self.parse)(input))));
        let took = memory::processor_time().saturating_sub(start);
        tally.executions += 1;
        tally.slowest = tally.slowest.max(took);
        tally.largest = tally.largest.max(bytes);
        let wrong = match &outcome {
            Err(panic) => {
                let text = panic.downcast_ref::<String>().map(String::as_str);
                Some(format!("it panics: {}", text.or(panic.downcast_ref::<&str>().copied()).unwrap_or_default()))
            }
            _ if took > MOST_TIME.mul_f64(1.0 + bytes as f64 / TIMED_BYTES as f64) => {
                Some(format!("it takes {:.1} s", took.as_secs_f64()))
            }
            _ if bytes > MOST_BYTES => Some(format!("it takes {bytes} bytes")),
            Ok(Err(error)) if self.reads_file && error.to_string().contains('\n') => {
                Some(format!("its error has several lines: {}", error.line()))
            }
            Ok(Err(error)) if self.reads_file && !error.to_string().contains(NAME) => {
                Some(format!("its error names no file: {error}"))
            }
            _ => None,
        };
        if let Some(what) = wrong {
            let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("fuzz");
            std::fs::create_dir_all(&folder).unwrap();
            let path = folder.join(format!("{}-{}", self.name, blake3::hash(input).to_hex().split_at(12).0));
            std::fs::write(&path, input).unwrap();
            panic!("{}: {what}; the input is kept as {}", self.name, path.display());
        }
        tally.read += u64::from(matches!(outcome, Ok(Ok(()))));
        outcome.map_or_else(|_| String::new(), |outcome| signature(&outcome))
    }

    /// Inputs that are in files, of which some once broke a parser.
    fn corpus(&self) -> Vec<Vec<u8>> {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fuzz/corpus").join(self.name);
        let files = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
        let mut files: Vec<_> = files.filter(|path| path.is_file()).collect();
        files.sort();
        files.iter().map(|path| std::fs::read(path).unwrap()).collect()
    }

    fn fuzz(&self, time: Duration, most: u64, seed: u64) -> Tally {
        let mut tally = Tally::default();
        let mut known = HashSet::new();
        let mut seeds = (self.seeds)();
        for input in &seeds {
            let said = self.run(input, &mut tally);
            assert!(tally.read == tally.executions, "{}: a seed is refused: {said}", self.name);
            known.insert(said);
        }
        let good = seeds.len();
        for input in self.corpus() {
            known.insert(self.run(&input, &mut tally));
            seeds.push(input);
        }
        let mut random = Rng::with_seed(seed);
        let start = Instant::now();
        while start.elapsed() < time && tally.executions < most {
            // Half of all inputs come of those that are good.
            let among = if random.bool() { good } else { seeds.len() };
            let one = random.usize(0..among);
            let other = random.usize(0..seeds.len());
            let input = mutate::mutated(&mut random, &seeds[one], &seeds[other], self.tokens);
            let before = tally.read;
            let said = self.run(&input, &mut tally);
            let is_new = if tally.read > before { random.u32(0..64) == 0 } else { known.insert(said) };
            if is_new && seeds.len() < MOST_SEEDS {
                seeds.push(input);
            } else if is_new {
                seeds[random.usize(MOST_SEEDS / 2..MOST_SEEDS)] = input;
            }
        }
        report(&format!(
            "{:12} {:>9} executions, {:>7.0} a second, {:>4.1} % read, {:>3} kinds of refusal, slowest {:.3} s, largest {:.1} MB",
            self.name,
            tally.executions,
            tally.executions as f64 / start.elapsed().as_secs_f64(),
            100.0 * tally.read as f64 / tally.executions as f64,
            known.len(),
            tally.slowest.as_secs_f64(),
            tally.largest as f64 / 1e6
        ));
        tally
    }
}

#[test]
fn parsers_survive_mutated_inputs() {
    let number = |name: &str| std::env::var(name).ok().map(|text| text.parse::<f64>().expect("a number"));
    let wanted = std::env::var("FUZZ_TARGET").ok();
    let chosen: Vec<&Target> = TARGETS.iter().filter(|t| wanted.as_ref().is_none_or(|name| name == t.name)).collect();
    assert!(!chosen.is_empty(), "no target has that name");
    let time = Duration::from_secs_f64(number("FUZZ_SECONDS").unwrap_or(SECONDS) / chosen.len() as f64);
    let seed = number("FUZZ_SEED").unwrap_or(1.0) as u64;
    let most = number("FUZZ_EXECUTIONS").map_or(u64::MAX, |most| most as u64);
    // What panics is told once, by this test.
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(|_| ()));
    let outcomes: Vec<_> = chosen.iter().map(|target| catch_unwind(|| target.fuzz(time, most, seed))).collect();
    std::panic::set_hook(hook);
    let mut broken = Vec::new();
    for (target, outcome) in chosen.iter().zip(outcomes) {
        match outcome {
            Ok(tally) => assert!(tally.read > 0, "{}: nothing was read", target.name),
            Err(panic) => broken.extend(panic.downcast_ref::<String>().cloned()),
        }
    }
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}
