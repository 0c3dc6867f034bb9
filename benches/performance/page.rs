//! The page the figures are written into.

use std::collections::HashMap;
use std::fs;

use support::repository;

use crate::figures::Table;

const PATH: &str = "docs/performance.md";
const BEGINS: &str = "<!-- bench begins -->\n";
const ENDS: &str = "<!-- bench ends -->";

/// `docs/performance.md`: text around the tables.
pub struct Page {
    before: String,
    tables: String,
    after: String,
}

impl Page {
    /// Panics, saying what is missing, if there is no place for the tables.
    pub fn read() -> Self {
        let text = fs::read_to_string(repository().join(PATH)).expect("docs/performance.md can be read");
        let (before, rest) = text.split_once(BEGINS).expect("it says where the tables begin");
        let (tables, after) = rest.split_once(ENDS).expect("it says where they end");
        Self {
            before: before.to_owned(),
            tables: tables.to_owned(),
            after: after.to_owned(),
        }
    }

    /// The figures that stand there, by what they are of.
    pub fn committed(&self) -> HashMap<String, f64> {
        let rows = self.tables.lines().filter_map(|line| {
            let mut cells = line.split('|').map(str::trim).skip(1);
            let (what, value) = (cells.next()?, cells.next()?);
            Some((what.to_owned(), value.parse().ok()?))
        });
        rows.collect()
    }

    pub fn write(&self, tables: &[Table]) {
        let tables: Vec<_> = tables.iter().map(Table::to_string).collect();
        let (before, after) = (&self.before, &self.after);
        let text = format!("{before}{BEGINS}{}{ENDS}{after}", tables.join("\n"));
        fs::write(repository().join(PATH), text).expect("docs/performance.md can be written");
    }
}
