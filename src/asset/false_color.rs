//! Errors as colours, with a scale bar.
//!
//! Magnitudes run from dark to light (viridis, whose brightness grows evenly, also in grey and for colour-blind
//! readers). Signed errors run from blue (too dark) over white to red (too bright), equally dark at both ends.

use super::lettering;
use super::picture::linear_from_srgb;

/// Quantity that the colours show.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Scheme {
    /// Blue where a value is too small, red where it is too large.
    #[default]
    Signed,
    /// Dark where a value is right, light where it is off.
    Absolute,
}

#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct ColorScale {
    pub scheme: Scheme,
    /// The error of the last colour; larger errors have the same colour.
    pub limit: f64,
}

/// Colour of surfaces without an error, because they are not lit. Linear RGB.
pub const NEUTRAL: [f32; 3] = [0.12; 3];
/// Colour of the background. Linear RGB.
pub const BACKGROUND: [f32; 3] = [0.03; 3];

impl ColorScale {
    /// A scale whose limit is the 99th percentile of the magnitudes, rounded up to 1, 2 or 5 times a power of ten.
    pub fn fitting(scheme: Scheme, errors: impl Iterator<Item = f64>) -> Self {
        let mut sorted: Vec<f64> = errors.map(f64::abs).filter(|e| e.is_finite()).collect();
        sorted.sort_by(f64::total_cmp);
        let rank = (sorted.len() as f64 * 0.99).ceil() as usize;
        let reached = sorted.get(rank.saturating_sub(1)).copied().unwrap_or(0.0).max(1e-9);
        let power = 10_f64.powi(reached.log10().floor() as i32);
        let step = [1.0, 2.0, 5.0].into_iter().find(|step| reached <= step * power * (1.0 + 1e-9));
        ColorScale { scheme, limit: step.unwrap_or(10.0) * power }
    }

    /// Linear RGB of an error; NaN is magenta.
    pub fn color(&self, error: f64) -> [f32; 3] {
        if error.is_nan() {
            return [1.0, 0.0, 1.0];
        }
        let part = error / self.limit;
        let color = match self.scheme {
            Scheme::Absolute => colorous::VIRIDIS.eval_continuous(part.abs().min(1.0)),
            // The published scheme runs from red to blue.
            Scheme::Signed => colorous::RED_BLUE.eval_continuous((0.5 - 0.5 * part).clamp(0.0, 1.0)),
        };
        [color.r, color.g, color.b].map(|c| linear_from_srgb(f32::from(c) / 255.0))
    }

    /// Errors that the bar labels.
    pub fn ticks(&self) -> Vec<f64> {
        let low = if self.scheme == Scheme::Signed { -4 } else { 0 };
        (low..=4).step_by(2).map(|i| f64::from(i) / 4.0 * self.limit).collect()
    }

    /// Adds a labelled colour bar below a picture of linear RGB triples. Returns the new picture and its height in
    /// pixels.
    pub fn with_bar(&self, rgb: &[f32], width: usize, title: &str) -> (Vec<f32>, usize) {
        let size = (width / 480).clamp(1, 4);
        let line = lettering::GLYPH * size + 4 * size;
        let edge = 8 * size;
        let bar_height = 14 * size;
        // A title that does not fit is wrapped.
        let columns = ((width.saturating_sub(2 * edge)) / lettering::width("0", size)).max(8);
        let title = wrap(title, columns);
        let top = rgb.len() / 3 / width;
        let height = top + edge + title.len() * line + bar_height + 2 * size + line + edge / 2;
        let mut out = rgb.to_vec();
        out.resize(3 * width * height, 0.0);
        let mut y = top + edge;
        for text in &title {
            lettering::write(&mut out, width, (edge, y), size, [1.0; 3], text);
            y += line;
        }
        let left = edge;
        let right = width.saturating_sub(edge).max(edge + 2);
        let low = self.ticks()[0];
        for x in left..right.min(width) {
            let part = (x - left) as f64 / (right - 1 - left) as f64;
            let color = self.color(low + part * (self.limit - low));
            for row in y..y + bar_height {
                out[3 * (row * width + x)..][..3].copy_from_slice(&color);
            }
        }
        y += bar_height;
        for tick in self.ticks() {
            let x = left as f64 + (tick - low) / (self.limit - low) * (right - 1 - left) as f64;
            for row in y..y + 2 * size {
                let at = 3 * (row * width + (x as usize).min(width - 1));
                out[at..at + 3].copy_from_slice(&[1.0; 3]);
            }
            let text = self.label(tick);
            let half = lettering::width(&text, size) / 2;
            let from = (x as usize).saturating_sub(half).clamp(left, right.saturating_sub(2 * half).max(left));
            lettering::write(&mut out, width, (from, y + 3 * size), size, [1.0; 3], &text);
        }
        (out, height)
    }

    /// Label of a tick: its sign, its value, and a mark if larger errors share its colour.
    fn label(&self, tick: f64) -> String {
        let digits = (2 - self.limit.log10().floor() as i32).clamp(0, 9) as usize;
        let number = format!("{:.digits$}", tick.abs());
        let number = if number.contains('.') { number.trim_end_matches('0').trim_end_matches('.') } else { &number };
        match (self.scheme, tick) {
            (_, 0.0) => "0".into(),
            (Scheme::Signed, t) if t < 0.0 => format!("-{number}"),
            (Scheme::Signed, _) => format!("+{number}"),
            (Scheme::Absolute, _) => number.to_owned(),
        }
    }
}

/// Lines of at most `columns` characters, broken between words.
fn wrap(text: &str, columns: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= columns => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    fn brightness([r, g, b]: [f32; 3]) -> f32 {
        0.2126 * r + 0.7152 * g + 0.0722 * b
    }

    #[test]
    fn larger_errors_are_lighter_or_deeper() {
        let absolute = ColorScale { scheme: Scheme::Absolute, limit: 0.2 };
        let signed = ColorScale { scheme: Scheme::Signed, limit: 0.2 };
        for i in 0..50 {
            let less = 0.004 * f64::from(i);
            let more = 0.004 * f64::from(i + 1);
            assert!(brightness(absolute.color(less)) < brightness(absolute.color(more)), "{more}");
            for sign in [-1.0, 1.0] {
                assert!(brightness(signed.color(sign * less)) >= brightness(signed.color(sign * more)), "{more}");
            }
        }
        let ([r, _, b], [dark_r, _, dark_b]) = (signed.color(0.15), signed.color(-0.15));
        assert!(r > b && dark_b > dark_r, "red is too bright, blue too dark");
        assert_eq!(absolute.color(-0.1), absolute.color(0.1));
        assert_eq!(signed.color(7.0), signed.color(0.2));
        assert_eq!(signed.color(f64::NAN), [1.0, 0.0, 1.0]);
    }

    #[test]
    fn limits_are_round() {
        let limit = |errors: &[f64]| ColorScale::fitting(Scheme::Signed, errors.iter().copied()).limit;
        for (reached, round) in [(0.011, 0.02), (-0.05, 0.05), (0.07, 0.1), (0.5, 0.5), (3.0, 5.0)] {
            assert!((limit(&[reached]) / round - 1.0).abs() < 1e-9, "{reached}");
        }
        assert!(limit(&[]) > 0.0 && limit(&[0.0, f64::NAN]) > 0.0);
        let mut many = vec![0.01; 999];
        many.push(50.0);
        assert!((limit(&many) - 0.01).abs() < 1e-9, "one in a thousand does not decide");
    }

    #[test]
    fn the_bar_spans_the_scale() {
        let scale = ColorScale { scheme: Scheme::Signed, limit: 0.05 };
        assert_eq!(
            scale.ticks().iter().map(|t| scale.label(*t)).collect::<Vec<_>>(),
            ["-0.05", "-0.025", "0", "+0.025", "+0.05"]
        );
        for width in [1, 40, 500, 1280] {
            let (picture, height) = scale.with_bar(&vec![0.5; 3 * width * 4], width, "error of the merge");
            assert_eq!(picture.len(), 3 * width * height);
            assert!(picture[..3 * width * 4].iter().all(|c| *c == 0.5), "the picture itself stays");
        }
        let (picture, height) = scale.with_bar(&vec![0.5; 3 * 500 * 4], 500, "error");
        let shown = |error: f64| picture.chunks_exact(3).any(|p| p == scale.color(error));
        assert!(shown(-0.05) && shown(0.05) && height > 30);
    }
}
