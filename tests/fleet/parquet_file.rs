//! The rows of a Parquet file.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;

use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::Field;

/// A row: its values by the names of their columns.
#[derive(Clone, Debug, PartialEq)]
pub struct Row(BTreeMap<String, Field>);

/// All rows of a file.
pub fn rows(path: &Path) -> Vec<Row> {
    let file = SerializedFileReader::new(File::open(path).expect("it is written")).expect("a table");
    let rows = file.get_row_iter(None).expect("rows");
    let row = |row: parquet::record::Row| Row(row.into_columns().into_iter().collect());
    rows.map(|found| row(found.expect("a row"))).collect()
}

impl Row {
    fn field(&self, column: &str) -> &Field {
        self.0
            .get(column)
            .unwrap_or_else(|| panic!("no {column} in {self:?}"))
    }

    /// NULL is empty.
    pub fn text(&self, column: &str) -> &str {
        match self.field(column) {
            Field::Str(text) => text,
            Field::Null => "",
            other => panic!("{column} {other:?}"),
        }
    }

    pub fn number(&self, column: &str) -> f64 {
        match self.field(column) {
            Field::Double(number) => *number,
            other => panic!("{column} {other:?}"),
        }
    }

    pub fn whole(&self, column: &str) -> i32 {
        match self.field(column) {
            Field::Int(number) => *number,
            other => panic!("{column} {other:?}"),
        }
    }

    pub fn flag(&self, column: &str) -> bool {
        match self.field(column) {
            Field::Bool(flag) => *flag,
            other => panic!("{column} {other:?}"),
        }
    }
}
