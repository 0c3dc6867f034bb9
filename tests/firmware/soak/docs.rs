//! The table of `docs/performance.md`, which `.ci/soak` writes, is of the faults there are.

use std::fs;

use support::repository;
use workbench::runs::soak::fault::Fault;
use workbench::runs::soak::tally::fixed_cells;

#[test]
fn the_table_in_the_docs_names_every_fault_with_its_bound() {
    let file = repository().join("docs/performance.md");
    let text = fs::read_to_string(file).expect("the file exists");
    let table = text.split_once("<!-- soak begins -->").expect("a table").1;
    let table = table.split_once("<!-- soak ends -->").expect("its end").0;
    let rows: Vec<_> = table
        .lines()
        .filter(|line| line.starts_with("| "))
        .skip(1)
        .collect();
    assert_eq!(rows.len(), Fault::ALL.len(), "run .ci/soak: {rows:?}");
    for (row, fault) in rows.into_iter().zip(Fault::ALL) {
        let expected = fixed_cells(fault);
        assert!(
            row.starts_with(&expected),
            "run .ci/soak: {row} is not of {expected}"
        );
    }
}
