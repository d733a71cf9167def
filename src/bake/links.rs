//! How light passes between the surfaces of a rigid group: what every vertex sees of it, as links to runs of neighbouring
//! vertices.
//!
//! Nothing of a group moves against it, so what a vertex sees is decided when its own visibility is baked, by the same
//! rays. Each ray that meets a front has a share of the cosine-weighted hemisphere, and goes to the smallest run around
//! the place that it meets. Runs that are too small as seen from the vertex become parts of larger ones, if those are
//! seen too, and all that light from a far wall takes is one link (Hanrahan, Salzman, Aupperle, *A Rapid Hierarchical
//! Radiosity Algorithm*, 1991). The sum of a vertex's links is the share of the hemisphere that shows fronts of the
//! group.

use super::cluster_order::{CLUSTER_RUNS, RUN_VERTICES, RunEnds, runs};
use super::own_visibility::PATTERN;
use crate::layout::CLUSTER_VERTICES;
use crate::shaders::ShaderPermutation;
use glam::Vec3;
use std::collections::BTreeMap;
use std::ops::Range;

/// Most vertices of a run, in the order of clusters: the smallest runs, which are of one side, clusters, and groups of
/// those.
pub const RUNS: [usize; 3] = [RUN_VERTICES, CLUSTER_VERTICES as usize, 512];
/// A run with a smaller share of the hemisphere becomes part of a larger one.
const LEAST_SHARE: f32 = 1.0 / 64.0;
/// Most links of a vertex. Where there are more, some take over the shares of their neighbours.
const MOST_LINKS: usize = 192;
/// A link with less than this share, of four rays, is blended with those of its neighbours where it leads to what lamps
/// light from close by; and how many such links a vertex has at most.
const FAINT: f32 = 4.0 / PATTERN as f32;
const MOST_FAINT: usize = 32;
/// Bits of the number of a run, below those of its share.
pub const RUN_BITS: u32 = 20;
/// Bits of how many links a vertex or a run has, below the number of its entity.
pub const COUNT_BITS: u32 = 12;
/// The upper half of the smallest share that is kept, 2^-31, as f32.
const LEAST_SHARE_BITS: u32 = (127 - 31) << 7;

/// The number of a run below its share, of at most 1: the upper half of an f32, less that of the smallest. `None` where the
/// share is smaller. Shares err by 0.4 %, small ones too: those of what is bright count.
pub fn pack(share: f32, number: u32) -> Option<u32> {
    let rounded = share.to_bits().saturating_add(1 << 15) >> 16;
    rounded.checked_sub(LEAST_SHARE_BITS).map(|bits| bits << RUN_BITS | number)
}

/// The number of a run, and its share.
pub fn unpack(packed: u32) -> (usize, f32) {
    let share = f32::from_bits(((packed >> RUN_BITS) + LEAST_SHARE_BITS) << 16);
    ((packed & ((1 << RUN_BITS) - 1)) as usize, share)
}

/// How many links there are, of a number that has the entity's above it.
pub fn count(packed: u32) -> usize {
    (packed & ((1 << COUNT_BITS) - 1)) as usize
}

/// A direction, ten bits an axis.
pub fn pack_direction(toward: Vec3) -> u32 {
    let [x, y, z] = toward.normalize_or_zero().to_array().map(|c| ((c + 1.0) * 511.5).round() as u32);
    x | y << 10 | z << 20
}

/// Not quite of unit length.
pub fn unpack_direction(packed: u32) -> Vec3 {
    let axis = |shift: u32| (packed >> shift & 1023) as f32 / 511.5 - 1.0;
    Vec3::new(axis(0), axis(10), axis(20))
}

/// The macros of shaders that read links.
pub fn macros(row: ShaderPermutation) -> ShaderPermutation {
    row.define("RUN_BITS", RUN_BITS).define("LEAST_SHARE_BITS", LEAST_SHARE_BITS).define("COUNT_BITS", COUNT_BITS)
}

/// Numbers of the runs of a group's members.
#[derive(Clone, Debug)]
pub struct Runs {
    members: Vec<MemberRuns>,
    pub count: u32,
    /// Of every run, whether it has vertices of different sides, as of both faces of a wall; empty where links are known.
    pub mixed: Vec<bool>,
    /// Whether it is of a lamp, or close under one; empty where none is.
    pub at_lamps: Vec<bool>,
}

#[derive(Clone, Debug)]
struct MemberRuns {
    /// The number of the first run of each size.
    firsts: [u32; RUNS.len()],
    /// The number of the first smallest run of every cluster, and that after the last.
    smallest: Vec<u32>,
    /// Where those end.
    ends: Vec<RunEnds>,
    vertices: usize,
}

impl MemberRuns {
    /// First vertices of the runs of a size, and how many they have.
    fn spans(&self, size: usize) -> Vec<(usize, usize)> {
        if size > 0 {
            let firsts = (0..self.vertices).step_by(RUNS[size]);
            return firsts.map(|first| (first, RUNS[size].min(self.vertices - first))).collect();
        }
        let clusters = (0..).step_by(RUNS[1]).zip(&self.ends);
        clusters.flat_map(|(first, ends)| runs(ends).map(move |run| (first + run.start, run.len()))).collect()
    }
}

impl Runs {
    /// For members of which the clusters have such runs.
    pub fn new<'r>(members: impl IntoIterator<Item = &'r [RunEnds]>) -> Self {
        let mut count = 0;
        let mut next = |runs: usize| {
            let first = count;
            count += runs as u32;
            first
        };
        let member = |ends: &[RunEnds]| {
            let mut smallest: Vec<u32> = ends.iter().map(|ends| next(runs(ends).count())).collect();
            let middle = next(ends.len());
            smallest.push(middle);
            let last = ends.last().map_or(0, |ends| usize::from(ends[CLUSTER_RUNS - 1]));
            let vertices = ends.len().saturating_sub(1) * RUNS[1] + last;
            let firsts = [smallest[0], middle, next(vertices.div_ceil(RUNS[2]))];
            MemberRuns { firsts, smallest, ends: ends.to_vec(), vertices }
        };
        let members = members.into_iter().map(member).collect();
        Runs { members, count, mixed: Vec::new(), at_lamps: Vec::new() }
    }

    /// The number of the run of a size that was met.
    fn of(&self, size: usize, met: &Met) -> u32 {
        let MemberRuns { firsts, smallest, ends, .. } = &self.members[met.member as usize];
        let place = met.place as usize;
        if size > 0 {
            return firsts[size] + (place / RUNS[size]) as u32;
        }
        let cluster = place / RUNS[1];
        let within = (place % RUNS[1]) as u8;
        smallest[cluster] + ends[cluster].partition_point(|end| *end <= within) as u32
    }

    /// Numbers of the runs of one size, `RUNS[size]`, and what [`Runs::all`] has of each.
    pub fn of_size(&self, size: usize) -> impl Iterator<Item = (u32, (usize, usize, usize))> {
        self.members.iter().enumerate().flat_map(move |(member, runs)| {
            (runs.firsts[size]..).zip(runs.spans(size)).map(move |(run, (first, count))| (run, (member, first, count)))
        })
    }

    /// Numbers of the next smaller runs that a run consists of.
    pub fn parts(&self, number: u32) -> Range<u32> {
        let member = self.members.partition_point(|member| member.firsts[0] <= number) - 1;
        let MemberRuns { firsts, smallest, .. } = &self.members[member];
        if number < firsts[1] {
            return 0..0;
        }
        if number < firsts[2] {
            let cluster = (number - firsts[1]) as usize;
            return smallest[cluster]..smallest[cluster + 1];
        }
        let ratio = (RUNS[2] / RUNS[1]) as u32;
        let first = firsts[1] + (number - firsts[2]) * ratio;
        first..(first + ratio).min(firsts[2])
    }

    /// Member, first vertex in the order of clusters, and number of vertices of every run.
    pub fn all(&self) -> impl Iterator<Item = (usize, usize, usize)> {
        self.members.iter().enumerate().flat_map(|(member, runs)| {
            let spans = (0..RUNS.len()).flat_map(|size| runs.spans(size));
            spans.map(move |(first, count)| (member, first, count))
        })
    }
}

/// A ray that meets a front.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Met {
    pub member: u32,
    /// The vertex that is nearest to the place, by its place in the order of clusters.
    pub place: u32,
    /// Which way that faces, see [`side`].
    pub side: u8,
    /// Direction of the ray.
    pub toward: Vec3,
    /// Share of the cosine-weighted hemisphere.
    pub share: f32,
    /// Whether it is linked by itself, however small its share is.
    pub apart: bool,
}

/// Which of six ways a normal points most.
pub fn side(normal: Vec3) -> u8 {
    let axis = normal.abs().max_position();
    2 * axis as u8 + u8::from(normal[axis] < 0.0)
}

/// Rays that go to one run.
#[derive(Clone, Copy, Default)]
struct Bundle {
    /// Member and side of one of them.
    of: (u32, u8),
    share: f32,
    /// Sum of their directions by their shares.
    toward: Vec3,
}

impl Bundle {
    fn of(bundles: impl IntoIterator<Item = Bundle>) -> Self {
        let add = |a: Bundle, b: Bundle| Bundle { of: b.of, share: a.share + b.share, toward: a.toward + b.toward };
        bundles.into_iter().fold(Bundle::default(), add)
    }
}

/// A link of a vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Link {
    /// The number of a run, and its share.
    pub packed: u32,
    /// Mean direction of its rays.
    pub direction: u32,
}

/// The links of one vertex, of which the rays met that.
pub fn links(mut met: Vec<Met>, runs: &Runs) -> Vec<Link> {
    met.sort_unstable_by_key(|met| (!met.apart, met.member, met.place));
    let (apart, others) = met.split_at(met.partition_point(|met| met.apart));
    let mut links = Vec::new();
    link(0, apart, runs, &mut links);
    let first = links.len();
    link(RUNS.len() - 1, others, runs, &mut links);
    if links.len() > MOST_LINKS {
        thin(&mut links, if first < MOST_LINKS / 2 { first } else { 0 });
    }
    let link = |(number, bundle): (u32, Bundle)| {
        Some(Link { packed: pack(bundle.share, number)?, direction: pack_direction(bundle.toward) })
    };
    links.into_iter().filter_map(link).collect()
}

/// The links of a cluster's vertices, of which all of one side have the mean of their faint links to what is bright at
/// lamps. The gap between a lamp and a ceiling is met by one ray or two, of few vertices, and each would be a blotch.
pub fn blend_faint(of_vertices: Vec<Vec<Link>>, sides: &[u8], runs: &Runs) -> Vec<Vec<Link>> {
    let is_faint = |link: &Link| {
        let (number, share) = unpack(link.packed);
        share < FAINT && runs.at_lamps[number]
    };
    let (faint, mut others): (Vec<Vec<Link>>, Vec<Vec<Link>>) =
        of_vertices.into_iter().map(|links| links.into_iter().partition(is_faint)).unzip();
    for side in 0..6 {
        let of_side = || (0..sides.len()).filter(|&at| sides[at] == side);
        let count = of_side().count() as f32;
        let mut means: BTreeMap<usize, (f32, u32)> = BTreeMap::new();
        for link in of_side().flat_map(|at| &faint[at]) {
            let (number, share) = unpack(link.packed);
            means.entry(number).or_insert((0.0, link.direction)).0 += share / count;
        }
        let mut means: Vec<(usize, (f32, u32))> = means.into_iter().collect();
        let whole: f32 = means.iter().map(|(_, (share, _))| share).sum();
        means.sort_by(|(_, a), (_, b)| b.0.total_cmp(&a.0));
        means.truncate(MOST_FAINT);
        let kept: f32 = means.iter().map(|(_, (share, _))| share).sum();
        let link = |(number, (share, direction)): (usize, (f32, u32))| {
            Some(Link { packed: pack(share * whole / kept, number as u32)?, direction })
        };
        let blended: Vec<Link> = means.into_iter().filter_map(link).collect();
        of_side().for_each(|at| others[at].extend(&blended));
    }
    others
}

/// Links runs of at most this size.
fn link(largest: usize, met: &[Met], runs: &Runs, links: &mut Vec<(u32, Bundle)>) {
    for of_largest in met.chunk_by(|a, b| runs.of(largest, a) == runs.of(largest, b)) {
        let rest = join(largest, of_largest, runs, links);
        links.extend(rest.filter(|rest| rest.share > 0.0).map(|rest| (runs.of(largest, &of_largest[0]), rest)));
    }
}

/// Leaves [`MOST_LINKS`]. Those from `first` on are thinned: of links that follow each other and lead to one side of a
/// member the largest takes over the shares of the others, until it has its part of all. Were the smallest left out
/// wherever they lead, a wall would lose the light of a window's sunny sill and frame, which are many small runs: a
/// third of its light.
fn thin(links: &mut Vec<(u32, Bundle)>, first: usize) {
    let mut many = links.split_off(first);
    let room = MOST_LINKS - first;
    let all = Bundle::of(many.iter().map(|(_, bundle)| *bundle)).share;
    many.sort_by_key(|(_, bundle)| bundle.of);
    let sides = many.chunk_by(|a, b| a.1.of == b.1.of).count();
    let is_split = sides <= room / 2;
    let least = all / (room - if is_split { sides } else { 0 }) as f32;
    for of_side in many.chunk_by(|a, b| !is_split || a.1.of == b.1.of) {
        let before = links.len();
        let mut rest: Vec<(u32, Bundle)> = Vec::new();
        let join = |of: &[(u32, Bundle)]| {
            let (number, _) = of.iter().max_by(|a, b| a.1.share.total_cmp(&b.1.share))?;
            Some((*number, Bundle::of(of.iter().map(|(_, bundle)| *bundle))))
        };
        for link in of_side {
            rest.push(*link);
            if rest.iter().map(|(_, bundle)| bundle.share).sum::<f32>() >= least {
                links.extend(join(&rest));
                rest.clear();
            }
        }
        // What is left over is less than a link.
        match links[before..].last_mut() {
            Some((_, last)) => *last = Bundle::of(rest.iter().map(|(_, bundle)| *bundle).chain([*last])),
            None => links.extend(join(&rest)),
        }
    }
}

/// Links the parts of a run that was met, so far as it may not stand for them; then the rays of all others. A run of
/// which the rays met less than half of the parts stands for none, and neither does one of several sides of which they
/// did not meet all: the others may be the far side of a wall, and all that is lit there would shine through it.
fn join(size: usize, met: &[Met], runs: &Runs, links: &mut Vec<(u32, Bundle)>) -> Option<Bundle> {
    if size == 0 {
        let bundle = |met: &Met| {
            let Met { member, side, share, toward, .. } = *met;
            Bundle { of: (member, side), share, toward: share * toward }
        };
        return Some(Bundle::of(met.iter().map(bundle)));
    }
    let mut small = Vec::new();
    let mut met_parts = 0;
    let mut is_whole = true;
    for part in met.chunk_by(|a, b| runs.of(size - 1, a) == runs.of(size - 1, b)) {
        met_parts += 1;
        let number = runs.of(size - 1, &part[0]);
        match join(size - 1, part, runs, links) {
            Some(bundle) if bundle.share >= LEAST_SHARE => links.push((number, bundle)),
            Some(bundle) => small.push((number, bundle)),
            None => is_whole = false,
        }
    }
    let number = runs.of(size, &met[0]);
    let parts = runs.parts(number).len();
    let is_mixed = runs.mixed.get(number as usize) == Some(&true);
    if is_whole && met_parts >= if is_mixed { parts } else { parts.div_ceil(2) } {
        return Some(Bundle::of(small.into_iter().map(|(_, bundle)| bundle)));
    }
    links.extend(small);
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Runs of vertices that are all of one side.
    fn plain(vertices: &[usize]) -> Runs {
        let of_cluster = |left: usize| std::array::from_fn(|run| (8 * run + 8).min(left) as u8);
        let ends = |&vertices: &usize| {
            let clusters = (0..vertices).step_by(64);
            clusters.map(|first| of_cluster((vertices - first).min(64))).collect::<Vec<RunEnds>>()
        };
        let ends: Vec<_> = vertices.iter().map(ends).collect();
        Runs::new(ends.iter().map(|ends| &ends[..]))
    }

    #[test]
    fn faint_links_at_lamps_are_shared_by_a_side() {
        let runs = Runs { at_lamps: vec![false, true, true], ..plain(&[8]) };
        let link = |(number, share): (u32, f32)| Link { packed: pack(share, number).unwrap(), direction: 0 };
        let found = [vec![(0, 0.5), (1, 0.004)], vec![(0, 0.001)], vec![(1, 0.002)], vec![(2, 0.25)]];
        let found = found.map(|links| links.into_iter().map(link).collect::<Vec<Link>>());
        let found = blend_faint(found.to_vec(), &[0, 0, 1, 0], &runs);
        let mean = 0.004 / 3.0;
        let wanted =
            [vec![(0, 0.5), (1, mean)], vec![(0, 0.001), (1, mean)], vec![(1, 0.002)], vec![(2, 0.25), (1, mean)]];
        for (found, wanted) in found.iter().zip(wanted) {
            let found: Vec<(usize, f32)> = found.iter().map(|link| unpack(link.packed)).collect();
            assert_eq!(found.len(), wanted.len(), "{found:?}");
            let is_near = |(a, b): (&(usize, f32), &(u32, f32))| a.0 == b.0 as usize && (a.1 / b.1 - 1.0).abs() < 0.005;
            assert!(found.iter().zip(&wanted).all(is_near), "{found:?} {wanted:?}");
        }
    }

    #[test]
    fn links_keep_the_share_of_all_rays_and_split_where_it_is_large() {
        let runs = plain(&[1000, 70]);
        assert_eq!(runs.count, 125 + 16 + 2 + 9 + 2 + 1);
        assert_eq!(runs.all().count() as u32, runs.count);
        assert_eq!(runs.all().last(), Some((1, 0, 70)));
        let all: Vec<_> = runs.all().collect();
        let sized: Vec<_> = (0..RUNS.len()).flat_map(|size| runs.of_size(size).collect::<Vec<_>>()).collect();
        assert_eq!(sized.len(), all.len());
        assert!(sized.iter().all(|(number, run)| all[*number as usize] == *run));
        for (number, (member, first, count)) in (0..).zip(&all) {
            let parts: Vec<_> = runs.parts(number).map(|part| all[part as usize]).collect();
            let small = *first..first + RUNS[0].min(*count);
            assert!(parts.is_empty() == (number < 125 || (143..152).contains(&number)), "{number} {small:?}");
            assert!(parts.iter().all(|part| part.0 == *member && part.1 >= *first));
            assert!(parts.is_empty() || parts.iter().map(|part| part.2).sum::<usize>() == *count);
        }
        let mut rng = fastrand::Rng::with_seed(1);
        // A tenth of the rays meet one smallest run, a third one cluster, the others anything.
        let met: Vec<Met> = (0..600)
            .map(|i| {
                let (member, place) = match i % 30 {
                    0..3 => (1, 8 + rng.u32(0..8)),
                    3..13 => (0, 128 + rng.u32(0..64)),
                    _ => (0, 256 + rng.u32(0..744)),
                };
                Met { member, place, side: 0, toward: Vec3::X, share: 1.0 / 700.0, apart: false }
            })
            .collect();
        let links = links(met, &runs);
        let share = |link: &Link| f64::from(unpack(link.packed).1);
        let run = |link: &Link| unpack(link.packed).0;
        assert!((links.iter().map(share).sum::<f64>() - 600.0 / 700.0).abs() < 1e-3);
        let of = |wanted: usize| links.iter().filter(|link| run(link) == wanted).map(share).sum::<f64>();
        assert!((of(143 + 1) - 60.0 / 700.0).abs() < 1e-3, "the smallest run");
        let cluster = 125 + 2;
        let within: f64 = (16..24).map(of).sum();
        assert!((of(cluster) + within - 200.0 / 700.0).abs() < 0.01, "the cluster or its runs");
        assert!(links.len() < 40, "{}", links.len());
    }

    #[test]
    fn small_shares_keep_their_size() {
        for share in [1.0, 0.3, 1.0 / 64.0, 2e-5, 3e-8] {
            let (number, found) = unpack(pack(share, 1_000_003).unwrap());
            assert!(number == 1_000_003 && (found / share - 1.0).abs() < 0.004, "{share}: {found}");
        }
        assert_eq!([0.0, 1e-10].map(|share| pack(share, 7)), [None; 2]);
    }

    /// Where there are too many links, those of what is bright stay as they are, and each side keeps its share.
    #[test]
    fn too_many_links_are_thinned_side_by_side() {
        let runs = plain(&[16_000, 80]);
        let is_small = |i: u32| i % 10 == 0;
        let dim = (0..250).map(|i| Met {
            member: 0,
            place: 64 * i,
            side: u8::from(is_small(i)),
            toward: Vec3::X,
            share: if is_small(i) { 1e-4 } else { 1e-3 },
            apart: false,
        });
        let bright =
            (0..10).map(|i| Met { member: 1, place: 8 * i, side: 0, toward: Vec3::X, share: 1e-6, apart: true });
        let links = links(dim.chain(bright).collect(), &runs);
        let first_bright = runs.of_size(0).find(|(_, (member, ..))| *member == 1).unwrap().0 as usize;
        let shares = |wanted: &dyn Fn(usize) -> bool| {
            let of_run = links.iter().map(|link| unpack(link.packed)).filter(|(run, _)| wanted(*run));
            of_run.map(|(_, share)| share).collect::<Vec<f32>>()
        };
        assert!((MOST_LINKS / 2..=MOST_LINKS).contains(&links.len()), "{}", links.len());
        let bright = shares(&|run| run >= first_bright);
        assert!(bright.len() == 10 && bright.iter().all(|share| (share - 1e-6).abs() < 1e-8), "{bright:?}");
        for (small, wanted) in [(false, 225e-3), (true, 25e-4)] {
            let of_side = shares(&|run| run < first_bright && is_small(run as u32 / 8) == small);
            let sum: f32 = of_side.iter().sum();
            assert!(!of_side.is_empty() && (sum / wanted - 1.0).abs() < 0.005, "{small}: {of_side:?}");
        }
    }

    /// Rays that meet one side of a run, which has another side in the dark, lead to that side alone.
    #[test]
    fn a_run_of_which_less_than_half_is_seen_stands_for_nothing() {
        let mut runs = plain(&[512]);
        let met = |runs: &Runs, places: u32| {
            links(
                (0..places)
                    .map(|i| Met { member: 0, place: 8 * i, side: 0, toward: Vec3::X, share: 1e-3, apart: false })
                    .collect(),
                runs,
            )
        };
        let largest = |links: Vec<Link>| links.iter().map(|link| unpack(link.packed).0).max();
        assert_eq!(largest(met(&runs, 3)), Some(2));
        assert_eq!(met(&runs, 3).len(), 3);
        // Four of eight clusters.
        assert_eq!(largest(met(&runs, 32)), Some(64 + 8));
        // Of two sides, all or none.
        runs.mixed = vec![true; 64 + 8 + 1];
        assert_eq!(largest(met(&runs, 32)), Some(64 + 3));
        assert_eq!(largest(met(&runs, 64)), Some(64 + 8));
    }
}
