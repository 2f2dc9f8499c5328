"""What is written as TOML is read back as it was."""

import math
import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vjm.io.files import toml_text
from vjm.io.model_file import build_chain, read_document

# TOML's texts are Unicode without lone surrogates
TEXTS = st.text(st.characters(exclude_categories=["Cs"]), max_size=12)
KEYS = TEXTS.filter(bool)
SCALARS = st.one_of(
    st.booleans(),
    st.integers(-(2**53), 2**53),
    st.floats(allow_nan=False, allow_infinity=False),
    TEXTS,
)
VALUES = st.recursive(SCALARS, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(KEYS, inner, max_size=4))


@given(st.dictionaries(KEYS, VALUES, max_size=5))
def test_documents_come_back(document):
    assert tomllib.loads(toml_text(document)) == document


@pytest.mark.parametrize("name", ["orthoglide-chain", "pinned-column"])
def test_models_come_back(name: str):
    document = read_document(name)
    again = tomllib.loads(toml_text(document.content))
    assert again == document.content
    assert build_chain(again, "again").name == name


def test_numbers_keep_their_kind_and_every_digit():
    found = tomllib.loads(toml_text({"a": 1, "b": 1.0, "c": math.pi, "d": 1e-300, "e": -0.0}))
    assert found == {"a": 1, "b": 1.0, "c": math.pi, "d": 1e-300, "e": 0.0}
    assert type(found["a"]) is int
    assert type(found["b"]) is float


def test_what_toml_lacks_is_refused():
    with pytest.raises(TypeError, match="NoneType"):
        toml_text({"a": None})
