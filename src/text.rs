//! Text files of results: CSV with its origin in the first line, numbers with three digits; and numbers of the command
//! line.

use crate::error::{Error, Result};
use serde::Serialize;
use serde_json::{Value, json};
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

/// Writes rows as NAME.csv, and with their origin as NAME.json.
pub fn write_rows(folder: &Path, name: &str, origin: &Value, rows: &impl Serialize) -> Result<()> {
    write(&folder.join(format!("{name}.csv")), csv(origin, rows))?;
    write(&folder.join(format!("{name}.json")), format!("{:#}\n", json!({ "origin": origin, "rows": rows })))
}

/// Rows, of which a list is made, as CSV: nested numbers get names joined by `_`, lists of objects are left out, and
/// the first line, after `#`, is `origin` as JSON.
pub fn csv(origin: &Value, rows: &impl Serialize) -> String {
    let rows = json!(rows);
    let rows = rows.as_array().map_or(&[][..], Vec::as_slice);
    let mut flat: Vec<Vec<(String, String)>> = rows.iter().map(|row| flatten("", row)).collect();
    // Columns of words come before columns of numbers, as judged by the first row.
    let words = |row: &Value| {
        flatten("", row).iter().map(|(_, value)| !value.is_empty() && value.parse::<f64>().is_err()).collect::<Vec<_>>()
    };
    if let Some(words) = rows.first().map(words) {
        for row in &mut flat {
            let (first, second): (Vec<_>, Vec<_>) =
                std::mem::take(row).into_iter().enumerate().partition(|(i, _)| words.get(*i) == Some(&true));
            *row = first.into_iter().chain(second).map(|(_, cell)| cell).collect();
        }
    }
    let mut text = format!("# {origin}\n");
    if let Some(first) = flat.first() {
        let line = |cells: Vec<String>| cells.iter().map(|c| quote(c)).collect::<Vec<_>>().join(",") + "\n";
        text += &line(first.iter().map(|(name, _)| name.clone()).collect());
        for row in flat {
            text += &line(row.into_iter().map(|(_, value)| value).collect());
        }
    }
    text
}

fn flatten(prefix: &str, value: &Value) -> Vec<(String, String)> {
    match value {
        Value::Object(map) => {
            let join = |key: &str| if prefix.is_empty() { key.to_owned() } else { format!("{prefix}_{key}") };
            map.iter().flat_map(|(key, value)| flatten(&join(key), value)).collect()
        }
        Value::Array(_) => Vec::new(),
        Value::Null => vec![(prefix.to_owned(), String::new())],
        Value::String(text) => vec![(prefix.to_owned(), text.clone())],
        other => vec![(prefix.to_owned(), other.to_string())],
    }
}

fn quote(cell: &str) -> String {
    if cell.contains([',', '"', '\n']) { format!("\"{}\"", cell.replace('"', "\"\"")) } else { cell.to_owned() }
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
    fn rows_become_columns() {
        let rows = [
            json!({"case": "a, b", "error": {"rms": 0.5, "max": 2}, "list": [1], "gone": null}),
            json!({"case": "c", "error": {"rms": 1e-9, "max": 0}, "list": [], "gone": 3}),
        ];
        let text = csv(&json!({"device": "d"}), &rows);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[0], "# {\"device\":\"d\"}");
        assert_eq!(lines.len(), 4);
        let column = lines[1].split(',').position(|c| c == "error_rms").unwrap();
        assert_eq!(lines[3].split(',').nth(column).unwrap().parse::<f64>().unwrap(), 1e-9);
        assert!(lines[2].contains("\"a, b\""));
    }

    #[test]
    fn three_digits() {
        let shown: Vec<String> = [0.012_345, 123.4, -0.0, 9876.5, 0.9996, -0.5, -1.5e22].map(three).to_vec();
        assert_eq!(shown, ["0.0123", "123", "0", "9876", "1.00", "-0.500", "-1.50e22"]);
    }
}
