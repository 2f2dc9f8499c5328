"""XML of other people's programs: bounded in size and depth, without entities, each element with its line."""

from __future__ import annotations

import pytest

from vjm.io import bounded_xml
from vjm.io.bounded_xml import parse_xml, read_xml
from vjm.io.errors import ModelFileError

LAUGHS = '<!DOCTYPE a [<!ENTITY a "ha">' + "".join(
    f'<!ENTITY a{i + 1} "{f"&a{i};" * 10}">' for i in range(9)
)  # fmt: skip


def refusal(text: str) -> str:
    with pytest.raises(ModelFileError) as caught:
        parse_xml(text.encode(), "f.xml")
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (LAUGHS + "]><a>&a9;</a>", "line 1: declares the entity 'a', which is not read"),
        ('<!DOCTYPE a [<!ENTITY f SYSTEM "file:///etc/passwd">]><a b="&f;"/>', "declares the entity 'f'"),
        ('<!DOCTYPE a [<!ENTITY % p "x">]><a/>', "declares the entity 'p'"),
        ("<a>" * 101 + "</a>" * 101, "nested deeper than 100"),
        ("\n\n<a></b>", "line 3: is no XML that can be read: mismatched tag"),
        ("<a/><b/>", "junk after document element"),
        ("text <a/>", "syntax error"),
        ('<a b="1" b="2"/>', "duplicate attribute"),
        ('<a b="&#0;"/>', "invalid character number"),
        ("<!-- without an end <a/>", "is no XML"),
        (" \n", "the file is empty"),
    ],
)
def test_what_is_no_bounded_xml_is_refused_in_one_line(text, says):
    assert says in refusal(text)


def test_files_and_trees_beyond_the_bounds_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(bounded_xml, "LARGEST", 2**20)
    monkeypatch.setattr(bounded_xml, "MOST", 1000)
    file = tmp_path / "f.xml"
    file.write_text("<a>" + " " * 2**20 + "</a>")
    with pytest.raises(ModelFileError, match="larger than 1 MB"):
        read_xml(file)
    assert "has more than 1000 elements" in refusal("<a>" + "<b/>" * 1000 + "</a>")
    assert len(parse_xml(("<a>" + "<b/>" * 999 + "</a>").encode(), "f.xml").root.children) == 999


@pytest.mark.parametrize(
    "text",
    [
        '<a b="1"/>',
        '\n<!-- c -- c\n --><?xml version="1.0"?>\n<!-- d --><a b="1"/>',
        '<!DOCTYPE a SYSTEM "no-such.dtd"><a b="1"/>',
        '<a b="1"><!-- <c/> --></a>',
    ],
)
def test_prologs_and_comments_change_nothing(text):
    root = parse_xml(text.encode(), "f.xml").root
    assert (root.tag, root.attributes, root.children) == ("a", {"b": "1"}, [])
    assert root.line == text[: text.index("<a")].count("\n") + 1


def test_prefixes_and_ampersands_stand_for_themselves():
    root = parse_xml(b'<a><x:b y:c="1 &amp; 2 & 3 &none; &#65;"/></a>', "f.xml").root
    (child,) = root.children
    assert (child.tag, child.attributes) == ("x:b", {"y:c": "1 & 2 & 3 &none; A"})
