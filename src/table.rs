//! Plain tables for people: columns as wide as their widest cell, names to the left, numbers to the right.

use std::io::{self, Write};

/// Rows of cells under a heading.
pub(crate) struct Table {
    rows: Vec<Vec<String>>,
}

impl Table {
    /// A table with these column titles.
    pub(crate) fn new(titles: &[&str]) -> Self {
        Self { rows: vec![titles.iter().map(ToString::to_string).collect()] }
    }

    /// Adds a row; the first cell is its name.
    pub(crate) fn row(&mut self, cells: Vec<String>) {
        self.rows.push(cells);
    }

    /// Writes the table and an empty line.
    pub(crate) fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(0);
        let cell = |row: &Vec<String>, c: usize| row.get(c).map_or(0, |t| t.chars().count());
        let widths: Vec<usize> = (0..columns).map(|c| self.rows.iter().map(|r| cell(r, c)).max().unwrap_or(0)).collect();
        for row in &self.rows {
            let mut line = String::new();
            for (c, (text, width)) in row.iter().zip(&widths).enumerate() {
                line += &if c == 0 { format!("{text:<width$}") } else { format!("  {text:>width$}") };
            }
            writeln!(out, "{}", line.trim_end())?;
        }
        writeln!(out)
    }
}

/// 1234567 as 1,234,567.
pub(crate) fn thousands(n: u64) -> String {
    let digits = n.to_string();
    let mut out = String::new();
    for (k, digit) in digits.chars().enumerate() {
        if k > 0 && (digits.len() - k).is_multiple_of(3) {
            out.push(',');
        }
        out.push(digit);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_line_up() {
        let mut table = Table::new(&["surface", "bytes"]);
        table.row(vec!["wall".into(), thousands(1_234_567)]);
        table.row(vec!["ceiling".into(), thousands(12)]);
        let mut out = vec![];
        table.write(&mut out).unwrap();
        assert_eq!(String::from_utf8(out).unwrap(), "surface      bytes\nwall     1,234,567\nceiling         12\n\n");
        assert_eq!([thousands(0), thousands(999), thousands(1_000)], ["0", "999", "1,000"]);
    }
}
