"""What counts as a page's words, and what as a sentence that stands on two pages."""

import words

SENTENCE = "An erase stops the processor for 45 ms, at most 400 ms."
WITHIN_BUDGET = {name: "" for names in words.BUDGETS for name in names}


def test_pages_within_their_budgets_have_no_complaint():
    assert words.report(WITHIN_BUDGET) == 0


def test_a_page_over_its_budget_is_named_with_the_excess(capsys):
    assert words.report({**WITHIN_BUDGET, "docs/wifi.md": "word " * 2003}) == 1
    assert "2003 of  2000  docs/wifi.md" in (output := capsys.readouterr().out)
    assert "3 over" in output


def test_pages_that_share_a_budget_are_added_up():
    assert words.report({**WITHIN_BUDGET, "CONTRIBUTING.md": "one " * 950, "CHANGELOG.md": "other " * 950}) == 0
    assert words.report({**WITHIN_BUDGET, "CONTRIBUTING.md": "one " * 950, "CHANGELOG.md": "other " * 951}) == 1


def test_a_page_without_a_budget_is_named_and_a_missing_one_shown(capsys):
    pages = {name: text for name, text in WITHIN_BUDGET.items() if name != "docs/fleet.md"}
    assert words.report({**pages, "docs/history.md": "word"}) == 1
    output = capsys.readouterr().out
    assert any("docs/history.md" in line and "not in the budget" in line for line in output.splitlines())
    assert any("docs/fleet.md" in line and "missing" in line for line in output.splitlines())


def test_readmes_of_folders_have_a_budget_each_and_do_not_count(capsys):
    assert words.report({**WITHIN_BUDGET, "tests/data/traces/README.md": "word " * 250}) == 0
    assert words.report({**WITHIN_BUDGET, "examples/README.md": "word " * 251}) == 1
    assert f"\n0 words of {sum(words.BUDGETS.values())}" in capsys.readouterr().out


def test_generated_pages_are_not_counted(capsys):
    assert words.report({**WITHIN_BUDGET, "docs/parameters.md": "word " * 9000}) == 0
    assert f"\n0 words of {sum(words.BUDGETS.values())}" in capsys.readouterr().out


def test_of_a_page_with_generated_tables_the_rest_counts(capsys):
    page = "two words <!-- bench begins -->\n| 1 | 2 |\n<!-- bench ends --> and three more"
    assert words.report({**WITHIN_BUDGET, "docs/performance.md": page}) == 0
    assert f"\n5 words of {sum(words.BUDGETS.values())}" in capsys.readouterr().out
    assert words.report({**WITHIN_BUDGET, "docs/performance.md": "word " * (sum(words.BUDGETS.values()) + 1)}) == 1


def test_a_sentence_on_two_pages_is_found_through_its_markup():
    pages = {
        "one.md": f"# One\nBefore. {SENTENCE} Behind.",
        "two.md": f"| flash | {SENTENCE.replace('erase', '[erase](one.md)').replace('45 ms', '`45 ms`')} |",
        "three.md": f"- {SENTENCE.replace('45', '46')}",
    }
    ((sentence, names),) = words.repeated_sentences(pages).items()
    assert sentence == SENTENCE.lower().rstrip(".")
    assert names == ["one.md", "two.md"]


def test_code_heads_of_tables_and_short_sentences_are_no_repetition():
    head = "| one two three four five six seven eight nine |\n|---|\n"
    text = f"{head}\n```sh\n{SENTENCE}\n```\nNot tried on a board.\n# One two three four five six seven eight\n"
    assert words.repeated_sentences({"one.md": text, "two.md": text}) == {}
