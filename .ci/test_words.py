"""Counting words, and finding sentences that stand on two pages."""

import pytest
import words

SENTENCE = "An erase stops the processor for 45 ms, at most 400 ms."


def test_the_words_of_each_page_are_printed(capsys):
    assert words.report({"one.md": "word " * 9000, "two.md": "| a | b |\n"}) == 0
    assert capsys.readouterr().out == "   9000 one.md\n      5 two.md\n0 sentences on two pages\n"


@pytest.mark.parametrize("arguments, pages, code", [
    (["--strict"], {"one.md": SENTENCE, "two.md": SENTENCE}, 1),
    ([], {"one.md": SENTENCE, "two.md": SENTENCE}, 0),
    (["--strict"], {"one.md": SENTENCE}, 0),
])  # fmt: skip
def test_strict_fails_on_a_repeated_sentence_only(monkeypatch, capsys, arguments, pages, code):
    monkeypatch.setattr("sys.argv", ["words.py", *arguments])
    monkeypatch.setattr(words, "pages_of", lambda repository: pages)
    with pytest.raises(SystemExit) as end:
        words.main()
    assert end.value.code == code
    assert ("on one.md and two.md: an erase stops" in capsys.readouterr().out) == (len(pages) == 2)


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
