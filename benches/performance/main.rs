//! What things cost on the emulated RP2040: the same figures in every run.
//!
//! `cargo bench` prints them and writes them into `docs/performance.md`. It fails, and leaves the page as it is, if something
//! takes over a tenth more than the page says; `cargo bench -- --accept` writes it all the same.

mod counted;
mod driven;
mod figures;
mod page;
mod running;
mod size;
mod wifi;

use std::process::ExitCode;

use figures::regressions;
use page::Page;

fn main() -> ExitCode {
    let tables = [
        counted::tables(),
        running::tables(),
        driven::tables(),
        wifi::tables(),
        size::tables(),
    ]
    .concat();
    for table in &tables {
        println!("{table}");
    }
    let figures = tables.iter().flat_map(|table| &table.figures);
    for missed in figures.filter(|figure| figure.is_missed()) {
        println!("goal not reached: {missed}");
    }

    let page = Page::read();
    let worse = regressions(&tables, &page.committed());
    for regression in &worse {
        println!("more than docs/performance.md says: {regression}");
    }
    if !worse.is_empty() && !std::env::args().any(|argument| argument == "--accept") {
        return ExitCode::FAILURE;
    }
    page.write(&tables);
    ExitCode::SUCCESS
}
