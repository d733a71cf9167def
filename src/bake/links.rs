//! How light passes between the surfaces of a rigid group: what every vertex sees of it, as links to runs of neighbouring
//! vertices.
//!
//! Nothing of a group moves against it, so what a vertex sees is decided when its own visibility is baked, by the same
//! rays. Each ray that meets a front has a share of the cosine-weighted hemisphere, and goes to the run of
//! [`RUNS`]`[0]` vertices around the place that it meets. Runs that are too small as seen from the vertex become parts
//! of larger ones, if those are seen too, and all that light from a far wall takes is one link (Hanrahan, Salzman,
//! Aupperle, *A Rapid Hierarchical Radiosity Algorithm*, 1991). The sum of a vertex's links is the share of the
//! hemisphere that shows fronts of the group.

use std::ops::Range;

/// Vertices of a run, in the order of clusters: the smallest runs, clusters, and groups of those.
pub const RUNS: [usize; 3] = [8, 64, 512];
/// A run with a smaller share of the hemisphere becomes part of a larger one.
const LEAST_SHARE: f32 = 1.0 / 64.0;
/// Most links of a vertex. Where there are more, the largest take over the shares of the others.
const MOST_LINKS: usize = 128;
/// Bits of the number of a run, below those of its share.
pub const RUN_BITS: u32 = 20;
/// The share that all bits above those stand for.
pub const WHOLE_SHARE: u32 = (1 << (32 - RUN_BITS)) - 1;

/// Numbers of the runs of a group's members.
#[derive(Clone, Debug)]
pub struct Runs {
    /// For each member the number of the first run of each size.
    firsts: Vec<[u32; RUNS.len()]>,
    vertex_counts: Vec<usize>,
    count: u32,
}

impl Runs {
    /// For members with so many vertices.
    pub fn new(vertex_counts: impl IntoIterator<Item = usize>) -> Self {
        let mut runs = Runs { firsts: Vec::new(), vertex_counts: Vec::new(), count: 0 };
        for vertices in vertex_counts {
            runs.firsts.push(RUNS.map(|size| {
                let first = runs.count;
                runs.count += vertices.div_ceil(size) as u32;
                first
            }));
            runs.vertex_counts.push(vertices);
        }
        runs
    }

    pub fn count(&self) -> u32 {
        self.count
    }

    /// The number of the run of a size that was met.
    fn of(&self, size: usize, met: &[Met]) -> u32 {
        self.firsts[met[0].member as usize][size] + met[0].place / RUNS[size] as u32
    }

    /// Numbers of the runs of one size, `RUNS[size]`, and what [`Runs::all`] has of each.
    pub fn of_size(&self, size: usize) -> impl Iterator<Item = (u32, (usize, usize, usize))> {
        let members = self.firsts.iter().zip(&self.vertex_counts).enumerate();
        members.flat_map(move |(member, (firsts, &vertices))| {
            let runs = (0..vertices).step_by(RUNS[size]);
            (firsts[size]..).zip(runs.map(move |first| (member, first, RUNS[size].min(vertices - first))))
        })
    }

    /// Numbers of the next smaller runs that a run consists of.
    pub fn parts(&self, number: u32) -> Range<u32> {
        let member = self.firsts.partition_point(|firsts| firsts[0] <= number) - 1;
        let firsts = self.firsts[member];
        let Some(size) = (1..RUNS.len()).rfind(|&size| firsts[size] <= number) else { return 0..0 };
        let ratio = (RUNS[size] / RUNS[size - 1]) as u32;
        let first = firsts[size - 1] + (number - firsts[size]) * ratio;
        first..(first + ratio).min(firsts[size])
    }

    /// Member, first vertex in the order of clusters, and number of vertices of every run.
    pub fn all(&self) -> impl Iterator<Item = (usize, usize, usize)> {
        self.vertex_counts.iter().enumerate().flat_map(|(member, &vertices)| {
            RUNS.into_iter().flat_map(move |size| {
                (0..vertices).step_by(size).map(move |first| (member, first, size.min(vertices - first)))
            })
        })
    }
}

/// A ray that meets a front.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Met {
    pub member: u32,
    /// The vertex that is nearest to the place, by its place in the order of clusters.
    pub place: u32,
    /// Share of the cosine-weighted hemisphere.
    pub share: f32,
}

/// The links of one vertex, of which the rays met that. Each has the number of a run and its share.
pub fn links(mut met: Vec<Met>, runs: &Runs) -> Vec<u32> {
    met.sort_unstable_by_key(|met| (met.member, met.place));
    let mut links: Vec<(u32, f32)> = Vec::new();
    const LARGEST: usize = RUNS.len() - 1;
    for of_largest in met.chunk_by(|a, b| is_one(LARGEST, a, b)) {
        let rest = join(LARGEST, of_largest, runs, &mut links);
        links.extend(rest.filter(|rest| *rest > 0.0).map(|rest| (runs.of(LARGEST, of_largest), rest)));
    }
    if links.len() > MOST_LINKS {
        let all: f32 = links.iter().map(|(_, share)| share).sum();
        links.select_nth_unstable_by(MOST_LINKS, |a, b| b.1.total_cmp(&a.1));
        links.truncate(MOST_LINKS);
        let kept: f32 = links.iter().map(|(_, share)| share).sum();
        links.iter_mut().for_each(|(_, share)| *share *= all / kept);
    }
    packed(&links)
}

fn is_one(size: usize, a: &Met, b: &Met) -> bool {
    a.member == b.member && a.place as usize / RUNS[size] == b.place as usize / RUNS[size]
}

/// Links the parts of a run that was met, so far as it may not stand for them; then the share of all others. A run of
/// which the rays met less than half of the parts stands for none: the others may be the far side of a wall, and all
/// that is lit there would shine through it.
fn join(size: usize, met: &[Met], runs: &Runs, links: &mut Vec<(u32, f32)>) -> Option<f32> {
    if size == 0 {
        return Some(met.iter().map(|met| met.share).sum());
    }
    let mut small = Vec::new();
    let mut met_parts = 0;
    let mut is_whole = true;
    for part in met.chunk_by(|a, b| is_one(size - 1, a, b)) {
        met_parts += 1;
        let number = runs.of(size - 1, part);
        match join(size - 1, part, runs, links) {
            Some(share) if share >= LEAST_SHARE => links.push((number, share)),
            Some(share) => small.push((number, share)),
            None => is_whole = false,
        }
    }
    if is_whole && 2 * met_parts >= runs.parts(runs.of(size, met)).len() {
        return Some(small.into_iter().map(|(_, share)| share).sum());
    }
    links.extend(small);
    None
}

/// Shares in whole steps, so that their sum stays.
fn packed(links: &[(u32, f32)]) -> Vec<u32> {
    // What rounding took from the shares so far.
    let mut lost = 0.0;
    let pack = |(run, share): &(u32, f32)| {
        let wanted = share * WHOLE_SHARE as f32 + lost;
        let whole = wanted.round().clamp(0.0, WHOLE_SHARE as f32);
        lost = wanted - whole;
        (whole > 0.0).then_some((whole as u32) << RUN_BITS | run)
    };
    links.iter().filter_map(pack).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_keep_the_share_of_all_rays_and_split_where_it_is_large() {
        let runs = Runs::new([1000, 70]);
        assert_eq!(runs.count(), 125 + 16 + 2 + 9 + 2 + 1);
        assert_eq!(runs.all().count() as u32, runs.count());
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
                Met { member, place, share: 1.0 / 700.0 }
            })
            .collect();
        let links = links(met, &runs);
        let share = |link: &u32| f64::from(link >> RUN_BITS) / f64::from(WHOLE_SHARE);
        let run = |link: &u32| link & ((1 << RUN_BITS) - 1);
        assert!((links.iter().map(share).sum::<f64>() - 600.0 / 700.0).abs() < 1e-3);
        let of = |wanted: u32| links.iter().filter(|link| run(link) == wanted).map(share).sum::<f64>();
        assert!((of(143 + 1) - 60.0 / 700.0).abs() < 1e-3, "the smallest run");
        let cluster = 125 + 2;
        let within: f64 = (16..24).map(of).sum();
        assert!((of(cluster) + within - 200.0 / 700.0).abs() < 0.01, "the cluster or its runs");
        assert!(links.len() < 40, "{}", links.len());
    }

    /// Rays that meet one side of a run, which has another side in the dark, lead to that side alone.
    #[test]
    fn a_run_of_which_less_than_half_is_seen_stands_for_nothing() {
        let runs = Runs::new([512]);
        let met =
            |places: u32| links((0..places).map(|i| Met { member: 0, place: 8 * i, share: 1e-3 }).collect(), &runs);
        let largest = |links: Vec<u32>| links.iter().map(|link| link & ((1 << RUN_BITS) - 1)).max();
        assert_eq!(largest(met(3)), Some(2));
        assert_eq!(met(3).len(), 3);
        // Four of eight clusters.
        assert_eq!(largest(met(32)), Some(64 + 8));
    }
}
