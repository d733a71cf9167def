//! Conclusions from a run's figures as text: which setting is the default and why, and where the merge is faster or slower than
//! ray casting.

use super::budget::Budget;
use super::pictures::CasePicture;
use super::rival::Comparison;
use super::sweep::Point;
use crate::text::three;
use std::fmt::Write;

/// Changes of time, error or bytes by less than this factor count as none, because medians of repeated runs differ by as much.
const NOISE: f64 = 1.02;
/// A setting that needs more than this many times the default's bytes cannot replace it.
const MORE_BYTES: f64 = 1.25;

/// Time, error and bytes of a setting relative to the default, case by case.
struct Ratios {
    time: Vec<f64>,
    error: Vec<f64>,
    bytes: Vec<f64>,
}

impl Ratios {
    fn new(points: &[&Point], defaults: &[&Point]) -> Self {
        let of = |value: &dyn Fn(&Point) -> f64| {
            points.iter().zip(defaults).map(|(p, d)| value(p) / value(d).max(f64::MIN_POSITIVE)).collect()
        };
        Ratios {
            time: points.iter().map(|p| p.time_per_default).collect(),
            error: of(&|p| p.total.rms),
            bytes: of(&|p| p.field_bytes as f64),
        }
    }

    /// The largest product of relative time and relative error over the cases.
    fn worst_product(&self) -> f64 {
        self.time.iter().zip(&self.error).map(|(t, e)| t * e).fold(0.0, f64::max)
    }

    fn takes_the_place(&self) -> bool {
        self.worst_product() < 1.0 / NOISE && self.bytes.iter().all(|b| *b <= MORE_BYTES)
    }

    /// The setting compared with the default, in words.
    fn word(&self) -> &'static str {
        let any = |of: &[f64], test: &dyn Fn(f64) -> bool| of.iter().any(|v| test(*v));
        let (more, less) = (|v: f64| v > NOISE, |v: f64| v < 1.0 / NOISE);
        let farther = any(&self.error, &more);
        let nearer = any(&self.error, &less);
        let dearer = any(&self.time, &more);
        let cheaper = any(&self.time, &less);
        let (larger, smaller) = (any(&self.bytes, &more), any(&self.bytes, &less));
        match (nearer, farther) {
            _ if self.takes_the_place() => "BETTER by the rule",
            (true, true) => "nearer in one case, farther in another",
            (true, false) if dearer => "nearer, but slower",
            (true, false) if larger => "nearer, but larger",
            (true, false) => "nearer",
            (false, true) if cheaper => "faster, but farther",
            (false, true) if smaller => "smaller, but farther",
            (false, true) => "farther, and no faster",
            (false, false) if dearer => "slower, and no nearer",
            (false, false) if larger => "larger, and no nearer",
            (false, false) if cheaper => "faster, as near",
            (false, false) if smaller => "smaller, as near",
            (false, false) => "no difference",
        }
    }
}

/// Description of the program's defaults.
fn default_in_words() -> String {
    let options = super::default_options();
    let bake = options.bake;
    format!(
        "lights {}, lattice {}, {} lookup, {}, {} px a face, {} bands of transfer and {} of visibility",
        format!("{:?}", options.lights).to_lowercase(),
        bake.lattice,
        format!("{:?}", options.lookup).to_lowercase(),
        format!("{:?}", bake.storage).to_lowercase(),
        bake.face_px,
        bake.bands,
        bake.occlusion_bands(),
    )
}

fn plural(count: usize, one: &str) -> String {
    if count == 1 { format!("1 {one}") } else { format!("{count} {one}s") }
}

/// Names of swept cases in their order.
pub fn swept(points: &[Point]) -> Vec<&str> {
    let mut cases: Vec<&str> = points.iter().map(|p| p.case.as_str()).collect();
    cases.dedup();
    cases
}

/// Time, error and bytes of the default in one case.
fn default_line(default: &Point) -> String {
    format!(
        "  {}: merged in {} ms (quarters {} to {}; the first time {} ms), off by {} (99 of 100 vertices below {}, the \
             worst {}), {} kB of fields.\n",
        default.case,
        three(default.merge_ms.median),
        three(default.merge_ms.lower),
        three(default.merge_ms.upper),
        three(default.first_merge_ms),
        three(default.total.rms),
        three(default.total.p99),
        three(default.total.max),
        default.field_bytes / 1024,
    )
}

/// Compares the default with all settings, one line per setting.
pub fn defaults(points: &[Point]) -> String {
    let cases = swept(points);
    let of_case = |case: &&str| points.iter().filter(|p| p.case == *case).collect();
    let by_case: Vec<Vec<&Point>> = cases.iter().map(of_case).collect();
    let defaults: Vec<&Point> = by_case.iter().filter_map(|points| points.first().copied()).collect();
    if defaults.is_empty() {
        return "Nothing was swept.\n".into();
    }
    let count = by_case[0].len();
    let mut text = format!(
        "Which setting is the default, and why\n\n\
         The default is {}.\n",
        default_in_words()
    );
    if let [only] = cases[..] {
        let _ = writeln!(text, "Only {only} was swept; a run of all cases judges by two.");
    }
    text.extend(defaults.iter().map(|default| default_line(default)));
    let _ = writeln!(
        text,
        "\nThe rule: another setting takes its place if time multiplied by error falls by more than {:.0} % (what two quiet runs may \
         differ\nby) in every swept case, with fields of at most {MORE_BYTES} times its bytes. A saving that costs more error \
         than it brings time, or a\ngain that costs more time than it brings error, is left to the user as an option; so is what \
         leaves long chains without a bound.",
        (NOISE - 1.0) * 100.0
    );
    let (mut lines, mut better, mut axis) = (String::new(), Vec::new(), "");
    for setting in 1..count {
        let points: Vec<&Point> = by_case.iter().filter_map(|of| of.get(setting).copied()).collect();
        let Some(point) = points.first() else { continue };
        let ratios = Ratios::new(&points, &defaults);
        if ratios.takes_the_place() {
            better.push(format!("{} {}", point.axis, point.name));
        }
        if axis != point.axis {
            axis = point.axis;
            let _ = writeln!(lines, "  {axis}");
        }
        let each = |values: &[f64]| values.iter().map(|v| format!("{:>7}", three(*v))).collect::<String>();
        let _ = writeln!(
            lines,
            "    {:<44}{}   {}   {}   {}",
            point.name,
            each(&ratios.time),
            each(&ratios.error),
            each(&ratios.bytes[..1]),
            ratios.word()
        );
    }
    text += &match better.is_empty() {
        true => format!("By this rule none of the {} takes its place.\n", plural(count - 1, "other setting")),
        false => format!("By this rule these would take its place: {}.\n", better.join("; ")),
    };
    let width = 7 * cases.len();
    let _ = writeln!(
        text,
        "\nIn units of the default, case by case ({}):\n    {:<44}{:>width$}   {:>width$}   {:>7}",
        cases.join("; "),
        "",
        "time",
        "error",
        "bytes",
    );
    text + &lines
}

/// One line per case with the speed-up at equal error, then the cases where it is below ten or below one.
pub fn rivals(comparisons: &[Comparison]) -> String {
    let mut text = String::from(
        "How many times faster the merge is than ray casting on all threads at equal error, and shadow maps on the same device\n\
         (a frame, everything merged, against the rays a point and light that err as little; sky and lights sampled directly, \
         hierarchies\nbuilt beforehand; at vertices without drawing, at pixels with it)\n",
    );
    let (mut losses, mut thin) = (Vec::new(), Vec::new());
    for c in comparisons {
        let (Some(times), Some(rays)) = (c.speed_up_at_equal_rms, c.rays_at_equal_rms) else {
            let _ = writeln!(text, "  {}: the rays' error does not fall; no comparison", c.title());
            continue;
        };
        let _ = writeln!(
            text,
            "  {}: {} times {} ({} ms at an error of {}; {} {} ms; the merge alone {} times)",
            c.title(),
            three(if times >= 1.0 { times } else { 1.0 / times }),
            if times >= 1.0 { "faster" } else { "SLOWER" },
            three(c.frame_wall_ms.median),
            three(c.merge_error.rms),
            if rays <= 1.0 { "one ray errs less and takes".into() } else { format!("{} rays take", three(rays)) },
            three(c.rival_ms_at_equal_rms.unwrap_or(f64::NAN)),
            three(c.merge_speed_up_at_equal_rms.unwrap_or(f64::NAN)),
        );
        text += &maps(c);
        if times < 1.0 {
            losses.push(c.title());
        } else if times < 10.0 {
            thin.push(c.title());
        }
    }
    if !losses.is_empty() {
        let _ = writeln!(text, "It LOSES in {}.", losses.join("; "));
    }
    if !thin.is_empty() {
        let _ = writeln!(text, "It leads by less than ten times in {}.", thin.join("; "));
    }
    if !losses.is_empty() || !thin.is_empty() {
        text += "There few rays reach what so few bands can: under small lights the shadow's edge, which bands blur, decides the \
                 error.\n";
    }
    text
}

/// A line on shadow maps: what the best of them errs, and the quickest that errs no more than the merge.
fn maps(c: &Comparison) -> String {
    let Some(best) = c.maps.iter().min_by(|a, b| a.error.rms.total_cmp(&b.error.rms)) else { return String::new() };
    let at_equal = match c.map_ms_at_equal_rms {
        Some(ms) => format!(
            "one that errs no more takes {} ms, {} times a frame",
            three(ms),
            three(ms / c.frame_wall_ms.median)
        ),
        None => "none errs as little".into(),
    };
    let (error, ms) = (three(best.error.rms), three(best.wall_ms.median));
    format!("    shadow maps: {at_equal}; the best, {}, errs {error} in {ms} ms\n", best.title())
}

/// Table of the rungs: root mean square, 99th percentile and maximum of each.
pub fn budgets(budgets: &[Budget]) -> String {
    let wide = budgets.iter().map(|b| b.case.len()).max().unwrap_or(0);
    let mut text = format!(
        "What a picture's error is made of\n(relative to the root mean square of the ray-cast radiosity T0; of each cause: root \
         mean square over vertices, what 99 of 100\nvertices stay below, the worst vertex)\n  {:<wide$}  {:^22}  {:^22}  {:^22}  \
         {:^22}  {:^22}  {:^22}  {:>7}\n",
        "", "centre rule", "four bands", "sampling", "arithmetic, storage", "total in SH", "sharp lights", "T0's own"
    );
    for b in budgets {
        let _ = write!(text, "  {:<wide$}", b.case);
        for rung in [b.centre_rule, b.bands, b.sampling, b.arithmetic_and_storage, b.total] {
            text += "  ";
            for value in [rung.rms, rung.p99, rung.max] {
                let _ = write!(text, "{:>7} ", short(value));
            }
            text.pop();
        }
        let sharp =
            b.sharp_total.map(|d| [d.rms, d.p99, d.max].map(short)).unwrap_or_else(|| ["-"; 3].map(String::from));
        let _ = write!(text, "   {:>7} {:>7} {:>7}", sharp[0], sharp[1], sharp[2]);
        let _ = writeln!(text, "  {:>8}", short(b.t0_error));
    }
    text
}

/// Table of what a person sees of the errors.
pub fn pictures(pictures: &[CasePicture]) -> String {
    let wide = pictures.iter().map(|p| p.case.len()).max().unwrap_or(0);
    let mut text = "What a person sees of it\n(the picture lit by vertex against that of rays cast to the same vertices: mean FLIP, which \
                    is 0 where nothing differs and at\nmost 1, the relative root mean square error over all lit vertices, and that of the \
                    rays themselves; then the program's own\npicture against rays cast from what each pixel shows: mean FLIP, the error of \
                    linear radiance over lit pixels, the rays' own)\n"
        .to_owned();
    let head = ["FLIP", "RMS", "rays'", "pixel FLIP", "pixel RMS", "rays'"].map(|word| format!("{word:>11}"));
    let _ = writeln!(text, "  {:<wide$}{}", "", head.concat());
    for p in pictures {
        let numbers = [p.mean_flip, p.errors.rms, p.errors.reference_error];
        let by_pixel = [p.pixels.mean_flip, p.pixels.rms, p.pixels.reference_error];
        let cells: String = numbers.iter().chain(&by_pixel).map(|value| format!("{:>11}", short(*value))).collect();
        let _ = writeln!(text, "  {:<wide$}{cells}", p.case);
    }
    text
}

/// A number with three significant digits; below 1e-4 as a power of ten.
fn short(value: f64) -> String {
    if value != 0.0 && value < 1e-4 { format!("{value:.0e}") } else { three(value) }
}
