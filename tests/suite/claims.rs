//! Numbers cited on the pages for users, compared with the committed tables from which they are taken.
//!
//! `tests/claims.csv` lists them: the page, the text with the number, the table, the rows (`column=value`,
//! `column~part`, `column!part`), the column, the reduction of the rows, and a factor. A number agrees if it is the
//! value rounded to its digits.

use std::collections::BTreeMap;
use std::path::Path;

type Row = BTreeMap<String, String>;

fn rows(path: &Path) -> Vec<Row> {
    let text = std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let mut reader = io::csv::Reader::new(&text).unwrap();
    let names: Vec<String> = reader.names().into_iter().map(str::to_owned).collect();
    let mut rows = Vec::new();
    while let Some(row) = reader.row() {
        let cells = row.cells().map(str::to_owned);
        rows.push(names.iter().cloned().zip(cells).collect());
    }
    rows
}

/// Returns `true` if a row meets all conditions.
fn holds(row: &Row, conditions: &str) -> bool {
    // A quantity may contain a semicolon, so that only a semicolon before a column begins a condition.
    let mut parts: Vec<String> = Vec::new();
    for part in conditions.split(';').filter(|part| !part.is_empty()) {
        let names_a_column = row.keys().any(|name| {
            part.strip_prefix(name.as_str())
                .is_some_and(|rest| rest.starts_with(['=', '~', '!']))
        });
        match parts.last_mut() {
            Some(last) if !names_a_column => *last = format!("{last};{part}"),
            _ => parts.push(part.to_owned()),
        }
    }
    parts.iter().all(|part| {
        let at = part
            .find(['=', '~', '!'])
            .unwrap_or_else(|| panic!("{part}"));
        let (name, value) = (&part[..at], &part[at + 1..]);
        let cell = &row[name];
        match part.as_bytes()[at] {
            b'=' => cell == value,
            b'~' => cell.contains(value),
            _ => !cell.contains(value),
        }
    })
}

/// Returns half a unit of the last digit of a number as written.
fn half_a_digit(figure: &str) -> f64 {
    let (digits, exponent) = figure.split_once('e').unwrap_or((figure, "0"));
    let decimals = digits
        .split_once('.')
        .map_or(0, |(_, decimals)| decimals.len());
    let exponent: i32 = exponent.parse().unwrap();
    0.5 * 10_f64.powi(exponent - i32::try_from(decimals).unwrap())
}

#[test]
fn figures_of_the_pages_are_those_of_the_tables() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let claims = rows(&root.join("tests/claims.csv"));
    assert!(claims.len() >= 25);
    let mut wrong = Vec::new();
    for claim in &claims {
        let (page, text, figure) = (&claim["page"], &claim["text"], &claim["figure"]);
        let words = std::fs::read_to_string(root.join(page)).unwrap();
        if !words.contains(text.as_str()) || !text.contains(figure.as_str()) {
            wrong.push(format!("{page} does not contain {text:?} with {figure}"));
            continue;
        }
        let table = rows(&root.join(&claim["table"]));
        let chosen = table.iter().filter(|row| holds(row, &claim["where"]));
        let values: Vec<f64> = chosen
            .filter_map(|row| row[&claim["column"]].parse::<f64>().ok())
            .map(f64::abs)
            .collect();
        let value = match claim["take"].as_str() {
            "count" => f64::from(u32::try_from(values.len()).unwrap()),
            "max" => values.iter().copied().fold(f64::NAN, f64::max),
            "min" => values.iter().copied().fold(f64::NAN, f64::min),
            other => panic!("{other}"),
        };
        let value = value * claim["scale"].parse::<f64>().unwrap();
        let cited: f64 = figure.parse().unwrap();
        let off = (value - cited).abs();
        if off.is_nan() || off > half_a_digit(figure) * (1.0 + 1e-9) {
            wrong.push(format!(
                "{page}: {text:?} cites {figure}, {} has {value}",
                claim["table"]
            ));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Checks the numbers of rows by status at the head of the criteria, and the number of test functions that they cite.
#[test]
fn the_criteria_count_their_rows() {
    const STATUSES: [&str; 4] = ["met", "in part", "not met", "not shown"];
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let page = std::fs::read_to_string(root.join("jobs/verification/criteria.md")).unwrap();
    let cells = |line: &str| -> Vec<String> {
        line.split(" | ")
            .map(|cell| cell.trim_matches(['|', ' ']).to_owned())
            .collect()
    };
    let (mut section, mut counts) = (String::new(), BTreeMap::<String, [usize; 4]>::new());
    for line in page.lines() {
        if let Some(title) = line.strip_prefix("## ") {
            title.clone_into(&mut section);
        }
        let row = cells(line);
        if row[0].len() == 4 && row[0].as_bytes()[1] == b'-' && row.len() > 3 {
            let status = |name: &str| row[2] == name || row[2].starts_with(&format!("{name}: "));
            let found = STATUSES.iter().position(|name| status(name));
            let found = found.unwrap_or_else(|| panic!("{}: {}", row[0], row[2]));
            for of in [section.as_str(), "all"] {
                counts.entry(of.to_owned()).or_default()[found] += 1;
            }
        }
    }
    assert_eq!(counts.len(), 5, "{counts:?}");
    for (name, counts) in counts {
        let numbers = counts.map(|count| count.to_string()).join(" | ");
        let line = format!("| {name} | {numbers} | {} |", counts.iter().sum::<usize>());
        assert!(page.contains(&line), "{line}");
    }
    let mut tests = 0;
    let mut folders = vec![
        root.join("src"),
        root.join("tests"),
        root.join("io"),
        root.join("decomposition"),
    ];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                let text = std::fs::read_to_string(path).unwrap();
                tests += text.lines().filter(|line| line.trim() == "#[test]").count();
            }
        }
    }
    assert!(
        page.contains("more than 1,300 test functions") && tests > 1300,
        "{tests}"
    );
}

#[test]
fn a_figure_is_right_within_half_of_its_last_digit() {
    let close = |figure: &str, half: f64| {
        assert!(
            (half_a_digit(figure) / half - 1.0).abs() < 1e-12,
            "{figure}"
        )
    };
    close("0.07", 0.005);
    close("438", 0.5);
    close("6e-14", 5e-15);
    close("1.2e-7", 5e-9);
}
