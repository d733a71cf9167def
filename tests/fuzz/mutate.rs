//! Changes of inputs.

use fastrand::Rng;

const LONGEST: usize = 1 << 16;

/// Numbers at which parsers go wrong.
const NUMBERS: &str = "\
    0 -0 1 -1 2 0.5 1e-7 1e7 1e9 1e15 1e38 1e39 1e300 1e-300 1e400 nan inf -inf 255 65536 2147483647 4294967296 \
    9223372036854775807 99999999999999999999";

/// The same as little-endian words.
const WORDS: [u32; 10] = [0, 1, 7, 0x7f, 0xff, 0xffff, 0x7fff_ffff, 0x8000_0000, 0x7fc0_0000, 0xffff_ffff];

/// An input changed in one to four ways, by another input and by words of the format, `tokens` between bars.
pub fn mutated(random: &mut Rng, input: &[u8], other: &[u8], tokens: &str) -> Vec<u8> {
    let mut out = input.to_vec();
    for _ in 0..1 << random.u32(0..3) {
        once(random, &mut out, other, tokens);
    }
    out.truncate(LONGEST);
    out
}

fn range(random: &mut Rng, length: usize, most: usize) -> std::ops::Range<usize> {
    let from = random.usize(0..=length);
    from..(from + random.usize(0..=most)).min(length)
}

fn once(random: &mut Rng, out: &mut Vec<u8>, other: &[u8], tokens: &str) {
    let length = out.len();
    match random.u32(0..12) {
        0 | 1 if length > 0 => out[random.usize(0..length)] ^= 1 << random.u32(0..8),
        2 if length > 0 => {
            out[random.usize(0..length)] = *random.choice(b"\0\x01\x7f\x80\xff \n\t-+.,:;#/\"'[]{}=e09").unwrap()
        }
        3 if length >= 4 => {
            let at = random.usize(0..=length - 4);
            out[at..at + 4].copy_from_slice(&random.choice(WORDS).unwrap().to_le_bytes());
        }
        4 => drop(out.drain(range(random, length, 16))),
        5 => drop(out.drain(range(random, length, length))),
        6 => {
            let piece = out[range(random, length, 64)].to_vec();
            let at = random.usize(0..=length);
            let times = if random.u32(0..16) == 0 { 64 } else { 1 };
            out.splice(at..at, piece.repeat(times));
        }
        7 => {
            let piece = &other[range(random, other.len(), 256)];
            let place = range(random, length, piece.len());
            out.splice(place, piece.iter().copied());
        }
        8 => {
            let at = random.usize(0..=length);
            out.truncate(at);
            out.extend_from_slice(&other[range(random, other.len(), other.len())]);
        }
        9 | 10 => number(random, out),
        _ => {
            let place = range(random, length, 8);
            let place = if random.bool() { place.start..place.start } else { place };
            out.splice(place, word(random, tokens, '|').bytes());
        }
    }
}

fn word<'t>(random: &mut Rng, words: &'t str, between: char) -> &'t str {
    let words: Vec<&str> = words.split(between).collect();
    words[random.usize(..words.len())]
}

fn number(random: &mut Rng, out: &mut Vec<u8>) {
    let is_part = |byte: &u8| byte.is_ascii_digit() || b".-+e".contains(byte);
    let begins: Vec<usize> =
        (0..out.len()).filter(|&i| is_part(&out[i]) && (i == 0 || !is_part(&out[i - 1]))).take(4096).collect();
    let Some(&from) = random.choice(&begins) else { return };
    let to = out[from..].iter().position(|byte| !is_part(byte)).map_or(out.len(), |length| from + length);
    out.splice(from..to, word(random, NUMBERS, ' ').bytes());
}
