"""Pages are plain: short sentences, short paragraphs, the field's terms; so are names and comments."""

import ast

import pytest
from helpers.plain_words import SOURCES, Block, Page, defined, in_name, markdown, names


@pytest.mark.parametrize("name", SOURCES)
def test_every_page_is_plain(name: str):
    """Of docstrings and messages, each by itself. There is prose to be read."""
    read = list(SOURCES[name]())
    assert {page.name: found for page in read if (found := page.offences())} == {}
    assert sum(len(block.text.split()) for page in read for block in page.blocks) > 200


def test_long_sentences_and_paragraphs_are_found():
    word = "one two three four five six seven eight nine ten "
    assert Page("", markdown(word * 4 + ".")).offences() == ["sentences have 40.0 words in the mean, more than 25"]
    assert "a sentence of 41 words in: one two" in Page("", markdown(word * 4 + "eleven.")).offences()[1]
    short = Page("", markdown(("One " + word + ". ") * 11)).offences()
    assert short == ["a paragraph of 121 words: One one two three four five six seven …"]
    assert Page("", markdown(("One " + word + ".\n\n") * 11)).offences() == []


def test_forbidden_words_are_found_in_prose_and_in_no_code():
    prose = Page("", markdown("The link gives way.\n\n| a |\n| --- |\n| It is wild. |\n\n- An *eased* part"))
    assert [line.split(",")[0] for line in prose.offences()] == ["“gives way”", "“wild”", "“eased”"]
    code = "`wild` and\n\n    validate wild\n\n```text\nwild\n```\n\n[a link](wild.md) and ![](wild.png) $wild$"
    assert Page("", markdown(code)).offences() == []
    assert len(Page("", markdown("An {term}`eased part <part>`.")).offences()) == 1
    nested = "::::{grid}\n:::{grid-item-card} Title\n:link: wild\nIt is wild.\n:::\n::::"
    assert len(Page("", markdown(nested)).offences()) == 1
    assert len(Page("", markdown("```{glossary}\nterm\n  It is wild.\n```")).offences()) == 1


def test_names_are_the_field_s():
    assert {f"{file}: {name}, say {in_name(name)}" for file, name in names()} == set()


def test_names_with_forbidden_words_are_found():
    source = """
def hung(steered, *, near_memory=0): told_apart = steered
class SoftestMode:
    eased: float
    def _yardstick(self): self.wild_ones = [mended for mended in ()]
from a import b as ladder
"""
    own = defined(ast.parse(source))
    assert {name for name in own if not in_name(name)} == {"self"}
    assert len(own) == 11
    for name in ("in_memory", "MemoryError", "natural_frequency", "swift", "bent", "play", "root_finder", "unhung"):
        assert not in_name(name), name


def test_sentences_end_where_a_reader_sees_it():
    text = "It is 3.5 mm, by Code. Then e.g. Kennedy et al. 2001 found Code. (22) is so."
    assert Block(text).sentences == [6, 8, 3]
    assert Block("A. Pashkevich found it at 2661 N. It is close.").sentences == [7, 3]
    assert Block("Is it? Yes! It is.").sentences == [2, 1, 2]
