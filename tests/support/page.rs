//! Generated parts of a page: the part between `<!-- NAME begins -->` and `<!-- NAME ends -->`.

use std::fs;

use crate::repository;

/// The page that describes `board-check`.
const PAGE: &str = "docs/proof.md";

/// Asserts that the part says what is `expected`. With `BOARD_CHECK_PAGE=write`
/// in the environment it is written there instead.
pub fn assert_part(name: &str, expected: &str) {
    let path = repository().join(PAGE);
    let (begin, end) = (
        format!("<!-- {name} begins -->\n"),
        format!("<!-- {name} ends -->"),
    );
    let page = fs::read_to_string(&path).expect("the page can be read");
    let (before, rest) = page.split_once(&begin).expect("where the part begins");
    let (written, after) = rest.split_once(&end).expect("where it ends");
    if std::env::var("BOARD_CHECK_PAGE").is_ok_and(|mode| mode == "write") {
        fs::write(&path, format!("{before}{begin}{expected}{end}{after}")).expect("it can be written");
        return;
    }
    assert!(
        written == expected,
        "{PAGE} is stale: run `BOARD_CHECK_PAGE=write cargo test --test host the_checks_are_on`\n{expected}"
    );
}
