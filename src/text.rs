//! Files of results, numbers with three digits, and numbers of the command line.

use crate::error::{Error, Result};
use std::ops::{Bound, RangeBounds};
use std::path::Path;
use std::str::FromStr;

/// Writes a file of results without leaving a partial one.
pub fn write(path: &Path, text: impl AsRef<[u8]>) -> Result<()> {
    crate::files::replace(path, text.as_ref())
        .map_err(|error| Error::Failed(format!("{}: cannot be written: {error}", path.display())))
}

/// Makes the folder that results go to, with those that it stands in.
pub fn make_folder(path: &Path) -> Result<()> {
    std::fs::create_dir_all(path).map_err(|error| Error::Failed(format!("{}: cannot be made: {error}", path.display())))
}

/// A number as text; very large and very small ones have an exponent (`1e15`).
pub fn short<T: Copy + Into<f64> + std::fmt::Display + std::fmt::LowerExp>(number: T) -> String {
    let size = number.into().abs();
    if size.is_finite() && size != 0.0 && !(1e-4..1e7).contains(&size) {
        format!("{number:e}")
    } else {
        number.to_string()
    }
}

/// A parser of finite numbers within a range, for options of the command line.
pub fn number<T>(range: impl RangeBounds<T> + Clone) -> impl Fn(&str) -> std::result::Result<T, String> + Clone
where
    T: FromStr + PartialOrd + Copy + Into<f64> + std::fmt::Display + std::fmt::LowerExp,
{
    move |text| {
        let number = text.trim().parse().ok().filter(|x: &T| range.contains(x) && (*x).into().is_finite());
        let from = match range.start_bound() {
            Bound::Included(least) => format!(" from {}", short(*least)),
            Bound::Excluded(limit) => format!(" above {}", short(*limit)),
            Bound::Unbounded => String::new(),
        };
        let to = match range.end_bound() {
            Bound::Included(most) => format!(" to {}", short(*most)),
            Bound::Excluded(limit) => format!(" below {}", short(*limit)),
            Bound::Unbounded => String::new(),
        };
        number.ok_or_else(|| format!("expected a number{from}{to}, got \"{text}\""))
    }
}

/// A parser of three numbers with commas between them.
pub fn triple<T>(
    number: impl Fn(&str) -> std::result::Result<T, String> + Clone,
) -> impl Fn(&str) -> std::result::Result<[T; 3], String> + Clone {
    move |text| {
        let numbers: Vec<T> = text.split(',').map(&number).collect::<std::result::Result<_, _>>()?;
        numbers.try_into().map_err(|_| format!("expected three numbers like 1,0.5,2, got \"{text}\""))
    }
}

/// A number with three significant digits; from a million on as a power of ten.
pub fn three(x: f64) -> String {
    if x == 0.0 || !x.is_finite() {
        return (x + 0.0).to_string();
    }
    if x.abs() >= 1e6 {
        return format!("{x:.2e}");
    }
    // The rounded number determines the digits: 0.9996 is written as 1.00.
    let rounded: f64 = format!("{x:.2e}").parse().unwrap_or(x);
    let digits = (2 - rounded.abs().log10().floor() as i32).clamp(0, 8) as usize;
    format!("{x:.digits$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_digits() {
        let shown: Vec<String> = [0.012_345, 123.4, -0.0, 9876.5, 0.9996, -0.5, -1.5e22].map(three).to_vec();
        assert_eq!(shown, ["0.0123", "123", "0", "9876", "1.00", "-0.500", "-1.50e22"]);
    }
}
