"""The wording check finds words that the glossary replaces, and long sentences."""

from __future__ import annotations

from tests.docs.wording import LONGEST, long_sentences_in, places, words_in


def found(text: str) -> list[str]:
    return [f"{p.line}: {p.what}" for p in words_in("a.py", text)]


def test_a_word_of_the_old_dialect_is_reported_with_the_better_one() -> None:
    assert found("The rig\nis told to stop.") == ["2: 'told': write state, report, print"]


def test_part_of_a_word_is_no_hit() -> None:
    assert found("indoors, amend, besides") == []


def test_a_key_that_the_contract_fixes_is_allowed() -> None:
    assert found('document["leftover"]') == []


def test_a_long_sentence_is_reported_and_a_short_one_is_not() -> None:
    long = " ".join(["word"] * (LONGEST + 1)) + "."
    text = f"A short one. {long}"
    (place,) = long_sentences_in("a.md", text)
    assert f"{LONGEST + 1} words" in place.what
    assert list(long_sentences_in("a.md", "Short. " * 20)) == []


def test_tables_code_and_generated_blocks_are_no_sentences() -> None:
    row = "| " + "word " * 60 + "|"
    code = "```\n" + "word " * 60 + "\n```"
    made = "<!-- x: made by python -m y -->\n" + "word " * 60 + "\n<!-- end of x -->"
    assert list(long_sentences_in("a.md", "\n\n".join([row, code, made]))) == []


def test_the_tree_uses_the_glossarys_words() -> None:
    assert [str(place) for place in places()] == []
