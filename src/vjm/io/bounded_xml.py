"""XML files of other people's programs: read with bounds on size and depth, and no entity of their own.

Taken as robots' simulators take them: prefixes need no declaration, a comment may stand before the header or hold
two hyphens, and an ampersand may stand for itself. Each element knows its line.
"""

from __future__ import annotations

import codecs
import re
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from vjm.io.errors import ModelFileError
from vjm.io.files import bounded_bytes

LARGEST = 64 * 2**20
"""Bytes; the largest public descriptions of robots have some 3 MB."""
DEEPEST, MOST = 100, 1_000_000
"""Nested elements, of which robots' files have less than ten, and all elements."""
_MARKS = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
    (b"<\0", "utf-16-le"),
    (b"\0<", "utf-16-be"),
)
_NO_FILE = {"idna", "punycode", "unicode-escape", "raw-unicode-escape", "undefined", "mbcs", "oem"}
"""Python's codecs that are no encoding of a text file; those of bytes fail when they are tried."""
_DECLARED = re.compile(r"<\?xml\b[^>]{0,200}?\bencoding\s*=\s*[\"']([^\"'>]{1,40})[\"']")
_HEADER = re.compile(r"<\?xml\b[^>]*>")
_AMPERSAND = re.compile(r"&(?!(?:amp|lt|gt|quot|apos|#[0-9]{1,7}|#x[0-9a-fA-F]{1,6});)")


@dataclass
class XmlElement:
    """One element.

    Attributes:
        tag: its name with any prefix, as written.
        attributes: by name, as written.
        line: where it begins, from 1.
        children: the elements in it.
        text: what is written between its tags where no element stands in it, without blanks at the ends.
    """

    tag: str
    attributes: dict[str, str]
    line: int
    children: list[XmlElement] = field(default_factory=list)
    text: str = ""

    def all(self, tag: str) -> list[XmlElement]:
        """The children of a name."""
        return [child for child in self.children if child.tag == tag]

    def first(self, tag: str) -> XmlElement | None:
        """The first child of a name."""
        return next((child for child in self.children if child.tag == tag), None)


@dataclass
class XmlFile:
    """A file as read.

    Attributes:
        root: its outermost element.
        notes: what was unusual about it, for people.
    """

    root: XmlElement
    notes: list[str]


def read_xml(path: Path) -> XmlFile:
    """The elements of an XML file.

    Raises:
        ModelFileError: it cannot be read, is too large or too deep, declares entities, or is not well-formed.
    """
    return parse_xml(bounded_bytes(path, LARGEST), path.name)


def parse_xml(raw: bytes, file: str) -> XmlFile:
    """The elements of an XML text; ``file`` is its name for messages.

    Raises:
        ModelFileError: as `read_xml`.
    """
    if len(raw) > LARGEST:
        raise ModelFileError(f"{file}: is larger than {LARGEST // 2**20} MB: no robot's description is")
    text, notes = _decoded(raw, file)
    if not text.strip():
        raise ModelFileError(f"{file}: the file is empty")
    return XmlFile(_XmlTree(file).parsed(_AMPERSAND.sub("&amp;", _without_prolog(_without_comments(text)))), notes)


def _decoded(raw: bytes, file: str) -> tuple[str, list[str]]:
    """The text of a file and what is to be said of its encoding."""
    mark = next((name for start, name in _MARKS if raw.startswith(start)), None)
    head = raw[:2000].decode(mark or "latin-1", "ignore")
    declaration = _DECLARED.search(head)
    declared = declaration.group(1).lower() if declaration else mark or "utf-8"
    # how the file begins says it for certain
    for encoding in (mark,) if mark else (declared, "utf-8", "cp1252", "latin-1"):
        if not _is_text(encoding):
            continue
        try:
            text = raw.decode("utf-8-sig" if encoding == "utf-8" else encoding)
        except (UnicodeError, LookupError) as error:
            if mark:
                raise ModelFileError(f"{file}: begins as {mark} and is not: save it as UTF-8") from error
            continue
        if _is_text(declared) and _family(encoding) == _family(declared):
            return text, []
        said = f"as its header declares ({declared})" if declaration else "as UTF-8"
        where = "" if mark else f" (line {_first_odd_line(raw, declared)})"
        return text, [f"the file is not encoded {said}{where}: read as {encoding}; save it as UTF-8"]
    raise ModelFileError(f"{file}: is no text: save it as UTF-8")


def _family(encoding: str) -> str:
    """An encoding's name without the order of its bytes."""
    return codecs.lookup(encoding).name.removesuffix("-le").removesuffix("-be").removesuffix("-sig")


def _is_text(encoding: str) -> bool:
    try:
        return codecs.lookup(encoding).name not in _NO_FILE
    except (LookupError, ValueError):
        return False


def _first_odd_line(raw: bytes, declared: str) -> int:
    try:
        raw.decode(declared)
    except UnicodeDecodeError as error:
        return raw[: error.start].count(b"\n") + 1
    except (UnicodeError, LookupError):
        pass
    return 1


def _without_comments(text: str) -> str:
    """Comments as blanks: XML forbids two hyphens in them, and people write them."""
    pieces, position = [], 0
    while (start := text.find("<!--", position)) >= 0 and (end := text.find("-->", start + 4)) >= 0:
        pieces += [text[position:start], "\n" * text.count("\n", start, end)]
        position = end + 3
    return "".join([*pieces, text[position:]])


def _without_prolog(text: str) -> str:
    """Headers before the first element as blanks: the text is decoded, and they may stand after other lines."""
    match = re.search(r"<[^?!\s]", text)
    first = match.start() if match else len(text)
    return _HEADER.sub(lambda header: "\n" * header.group().count("\n"), text[:first]) + text[first:]


class _XmlTree:
    """Builds elements from what expat finds."""

    def __init__(self, file: str) -> None:
        self._file = file
        self._open: list[XmlElement] = []
        self._root: XmlElement | None = None
        self._count = 0
        self._texts: list[str] = []
        # without a separator for namespaces a prefix is a part of the name
        self._parser = expat.ParserCreate(namespace_separator=None)
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.CharacterDataHandler = self._texts.append
        self._parser.EntityDeclHandler = self._entity
        self._parser.SetParamEntityParsing(expat.XML_PARAM_ENTITY_PARSING_NEVER)

    def parsed(self, text: str) -> XmlElement:
        try:
            self._parser.Parse(text, True)
        except expat.ExpatError as error:
            why = expat.errors.messages.get(error.code, "not well-formed")
            raise ModelFileError(f"{self._file}: line {error.lineno}: is no XML that can be read: {why}") from error
        except UnicodeEncodeError as error:
            raise ModelFileError(f"{self._file}: is no text: save it as UTF-8") from error
        assert self._root is not None
        return self._root

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        self._count += 1
        if self._count > MOST or len(self._open) >= DEEPEST:
            raise self._error(
                f"has more than {MOST} elements" if self._count > MOST else f"is nested deeper than {DEEPEST}"
            )
        self._texts.clear()
        element = XmlElement(tag, attributes, self._parser.CurrentLineNumber)
        if self._open:
            self._open[-1].children.append(element)
        else:
            self._root = element
        self._open.append(element)

    def _end(self, _tag: str) -> None:
        # that of an element with others in it is nobody's: numbers and names stand in the innermost ones
        element = self._open.pop()
        if not element.children:
            element.text = "".join(self._texts).strip()
        self._texts.clear()

    def _entity(self, name: str, *_: object) -> None:
        raise self._error(f"declares the entity '{name}', which is not read: write its text where it stands")

    def _error(self, what: str) -> ModelFileError:
        return ModelFileError(f"{self._file}: line {self._parser.CurrentLineNumber}: {what}")
