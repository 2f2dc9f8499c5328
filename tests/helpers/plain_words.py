"""How plain prose and names are: lengths of sentences and paragraphs, and words that have better terms.

``PYTHONPATH=tests python -m helpers.plain_words`` counts the offences of every source, page by page with ``-v``.
"""

import ast
import inspect
import itertools
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

from markdown_it import MarkdownIt
from markdown_it.token import Token
from mdit_py_plugins.amsmath import amsmath_plugin
from mdit_py_plugins.colon_fence import colon_fence_plugin
from mdit_py_plugins.dollarmath import dollarmath_plugin

from helpers.source_trees import parsed

ROOT = Path(__file__).parents[2]
PACKAGES = ("src", "fea", "validation")
GENERATED = re.compile(r"reference/(cli|.*-keys)\.md|/(_build|gallery_built)/")
"""Pages that the site's build makes of the programs: their prose is that of docstrings."""
MEAN, LONGEST, PARAGRAPH = 25, 40, 120
"""Words: of a sentence in the mean of a page, of the longest sentence, of the longest paragraph."""

FORBIDDEN = {
    r"wild": "outlier",
    r"(?<!resident )(?<!working )memory": "autocorrelation; history for creep",
    r"steer(s|ed|ing)?": "controlled",
    r"(gives?|gave|giving) way": "deflects, yields",
    r"hung": "transmitted load; stuck for a gauge",
    r"strained": "prestressed; prior-dominated",
    r"softest": "smallest eigenvalue",
    r"firmest": "stiffest",
    r"eased": "partially unloaded",
    r"bent": "rest shape; curved, deflected",
    r"natural(?! (frequenc|motion|logarithm))": "rest shape",
    r"ladder": "stepwise selection; verification hierarchy",
    r"yardsticks?": "reference",
    r"(what|all that) is left|lacking": "residual",
    r"(tells?|told|telling)( \w+)? apart": "distinguishable",
    r"given sets": "third-party sets",
    r"swings?": "is a mechanism; oscillates",
    r"ways": "loading and unloading; directions",
    r"mend(ed|s|ing)?": "corrected",
    r"bends? over|bend-over": "stiffness knee; critical point where it is one",
    r"plays?": "backlash, clearance",
    r"programme": "load case",
    r"strangers?": "cause outside the catalogue",
    r"finders?": "diagnosis",
}
"""Word, as a pattern, and the term to write instead."""
_FORBIDDEN = {re.compile(rf"\b(?:{word})\b", re.IGNORECASE): term for word, term in FORBIDDEN.items()}
_ANY_FORBIDDEN = re.compile(rf"\b(?:{'|'.join(FORBIDDEN)})\b", re.IGNORECASE)
IN_NAMES = {
    r"natural(?! (frequenc|motion|logarithm))": "coordinates free of stress, as the compiled kernels call them",
    r"bent": "a posture of the library",
    r"ways": "plain English where no loading is meant",
    r"plays?": "the cause `play`, a name that users' files have",
    r"finders?": "a finder of roots",
    r"(what|all that) is left|lacking": "what is missing, such as an extra",
}
"""Words that names may have, and as what."""
COMPUTER = r"(?<!in )(?<!of )(?<!free )(?<!peak )memory(?! (error|gb))"
"""`memory` that is not a computer's."""
_NAMES = {
    re.compile(rf"\b(?:{COMPUTER if 'memory' in word else word})\b"): term
    for word, term in {**FORBIDDEN, r"rungs?": "step"}.items()
    if word not in IN_NAMES
}
_CODE = "Code"
"""What stands for a code span or a formula: one word, which no rule reads."""
_ABBREVIATED = re.compile(r"\b(e\.g|i\.e|eq|eqs|fig|et al|vs|cf|approx|ed|resp|(?<!\d )[A-Z])\.$", re.IGNORECASE)
_PRAGMA = re.compile(r"# *(noqa|type:|fmt:|%%|ruff:|pragma|-+$|!)")
_STRING_OR_COMMENT = re.compile(
    r"""#.*|(?s:\"{3}(?:\\.|[^\\])*?\"{3}|'{3}(?:\\.|[^\\])*?'{3})|"(?:\\[\s\S]|[^"\\\n])*"|'(?:\\[\s\S]|[^'\\\n])*'"""
)
_PROSE_FENCES = ("{glossary}", "{admonition}", "{note}", "{tip}", "{warning}", "{important}")


@dataclass(frozen=True)
class Block:
    """Prose between two breaks.

    Attributes:
        text: words, with one word in place of a code span or a formula.
        cell: whether it is a cell of a table or a heading, which count neither in the mean nor as paragraphs.
    """

    text: str
    cell: bool = False

    @property
    def sentences(self) -> list[int]:
        """Words of each sentence."""
        pieces = [""]
        for piece in re.split(r"(?<=[.!?])[)\"”]?\s+(?=[\W\d]*[A-ZÄÖÜ0-9*])", self.text):
            pieces[-1] = f"{pieces[-1]} {piece}".strip()
            if not _ABBREVIATED.search(piece):
                pieces.append("")
        return [count for piece in pieces if (count := words(piece))]


@dataclass(frozen=True)
class Page:
    """Prose that a reader meets together: a page, a docstring, a message."""

    name: str
    blocks: tuple[Block, ...]
    sentences: bool = True
    """Whether lengths count: comments have formulas, of which each sign would be a word."""

    def offences(self) -> list[str]:
        """What is not plain in it, one line each."""
        counts = [n for block in self.blocks if self.sentences and not block.cell for n in block.sentences]
        found = []
        if counts and (mean := sum(counts) / len(counts)) > MEAN:
            found.append(f"sentences have {mean:.1f} words in the mean, more than {MEAN}")
        for block in self.blocks:
            begin = " ".join(block.text.split()[:8])
            found += [
                f"a sentence of {n} words in: {begin} …" for n in block.sentences if n > LONGEST and self.sentences
            ]
            if self.sentences and not block.cell and (n := words(block.text)) > PARAGRAPH:
                found.append(f"a paragraph of {n} words: {begin} …")
            for pattern, term in _FORBIDDEN.items() if _ANY_FORBIDDEN.search(block.text) else ():
                for match in pattern.finditer(block.text):
                    found.append(f"“{match[0]}”, say {term}: … {_around(block.text, match)} …")
        return found


def words(text: str) -> int:
    """Words of a text; signs that stand alone are none."""
    return len(re.findall(r"\w[\w'’.,/×^+-]*", text))


def _around(text: str, match: re.Match[str]) -> str:
    return text[max(0, match.start() - 30) : match.end() + 30]


def _parser() -> MarkdownIt:
    parser = MarkdownIt("commonmark").enable("table")
    return parser.use(dollarmath_plugin).use(amsmath_plugin).use(colon_fence_plugin)


_PARSER = _parser()
_SPAN = re.compile(r"(?<!`)`[^`\n]+`(?!`)")
_MARKUP = re.compile(r"[^\w\n ,.;:?!'\"’“”()/%=×°²³·–—…-]|^ |^[-=:\d]|(?<![A-Za-z0-9])_|_(?!\w)", re.MULTILINE)
"""What may be Markdown: any sign that prose does not have, and what begins a list, a rule or code."""


def markdown(text: str) -> tuple[Block, ...]:
    """The prose of a Markdown page, without code, formulas and the options of directives."""
    if not _MARKUP.search(prose := _SPAN.sub(_CODE, text)):
        return tuple(Block(" ".join(part.split())) for part in re.split(r"\n\s*\n", prose) if part.strip())
    text = re.sub(r"\{term\}`([^`<]*?)(\s*<[^`]*>)?`", r"\1", text)
    return tuple(_blocks(_PARSER.parse(text)))


def _blocks(tokens: list[Token]) -> Iterator[Block]:
    opened: list[str] = []
    for token in tokens:
        if token.type.endswith("_open"):
            opened.append(token.type)
        elif token.type.endswith("_close"):
            opened.pop()
        elif token.type == "inline":
            text = "".join(map(_text, token.children or [])).strip()
            if text:
                yield Block(text, cell=opened[-1] in {"th_open", "td_open", "heading_open"})
        elif token.type == "colon_fence" or token.info.startswith(_PROSE_FENCES):
            content = re.sub(r"^(:[\w-]+:.*\n)+", "", token.content)
            yield from markdown(re.sub(r"^ {2,}", "\n", content, flags=re.MULTILINE))


def _text(token: Token) -> str:
    if token.type in {"code_inline", "math_inline"}:
        return _CODE
    if token.type in {"softbreak", "hardbreak"}:
        return " "
    if token.type == "image":
        return ""
    return token.content if token.type == "text" else ""


def pages() -> Iterator[Page]:
    """README, CONTRIBUTING, the site's pages and those of the examples, which the site includes."""
    files = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
    files += sorted((ROOT / "validation").rglob("examples/*/README.md"))
    for file in files:
        if not GENERATED.search(file.as_posix()):
            yield Page(_name(file), markdown(file.read_text(encoding="utf-8")))


def gallery() -> Iterator[Page]:
    """The gallery's programs, whose docstring and comments are its pages."""
    for file in sorted((ROOT / "docs/gallery").glob("*.py")):
        text = file.read_text(encoding="utf-8")
        comments = re.sub(r"^# ?(%%|-+$)?", "", "\n".join(re.findall(r"^#.*", text, re.M)), flags=re.M)
        yield Page(_name(file), markdown(_plain(f"{ast.get_docstring(ast.parse(text))}\n\n{comments}")))


def docstrings() -> Iterator[Page]:
    """Docstrings of the packages, those of constants and fields included."""
    for file, tree in _trees():
        for node in ast.walk(tree):
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
                text = ast.get_docstring(node)
                if text:
                    name = f"{_name(file)}:{getattr(node, 'name', '')}"
                    yield Page(name, markdown(_plain(inspect.cleandoc(text))))
                for text in _of_constants(node):
                    blocks = markdown(_plain(inspect.cleandoc(text)))
                    yield Page(f"{_name(file)}:{text[:20]}", tuple(replace(block, cell=True) for block in blocks))


def _of_constants(node: ast.AST) -> Iterator[str]:
    """What stands below the assignments of a module or a class."""
    body: list[ast.stmt] = getattr(node, "body", [])
    for before, after in itertools.pairwise(body):
        match before, after:
            case ast.Assign() | ast.AnnAssign(), ast.Expr(value=ast.Constant(value=str(text))):
                yield text


def comments() -> Iterator[Page]:
    """Comments of the packages and the tests; those in a row are one text."""
    for file in _files((*PACKAGES, "tests")):
        found: list[tuple[int, str]] = []
        source = file.read_text(encoding="utf-8")
        for token in _STRING_OR_COMMENT.finditer(source):
            if token[0].startswith("#") and not _PRAGMA.match(token[0]):
                line, text = source.count("\n", 0, token.start()) + 1, token[0].lstrip("# ")
                if found and line == found[-1][0] + 1:
                    text = f"{found.pop()[1]} {text}"
                found.append((line, text))
        yield from (Page(f"{_name(file)}:{line}", (Block(text),), sentences=False) for line, text in found)


def names() -> Iterator[tuple[str, str]]:
    """File, and a name with a word for which the field has another: what programs and tests define, and files."""
    for file in _files((*PACKAGES, "tests")):
        used = {file.stem, *re.findall(r"\w+", file.read_text(encoding="utf-8"))}
        if any(map(in_name, used)):
            own = {file.stem, *defined(parsed(file))}
            yield from ((_name(file), name) for name in sorted(own) if in_name(name))


def defined(tree: ast.Module) -> set[str]:
    """Names of functions, classes, parameters, variables and fields that a module defines."""
    found = set()
    for node in ast.walk(tree):
        match node:
            case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name) | ast.ClassDef(name=name):
                found.add(name)
            case ast.Name(id=name, ctx=ast.Store()) | ast.arg(arg=name) | ast.alias(asname=str(name)):
                found.add(name)
            case ast.Attribute(attr=name, ctx=ast.Store()):
                found.add(name)
    return found


@cache
def in_name(name: str) -> str:
    """The term for the first word of a name that the field has a better one for; empty where there is none.

    Example:
        >>> in_name("WildSamples"), in_name("in_memory")
        ('outlier', '')
    """
    words_of_it = " ".join(re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+", name)).lower()
    return next((term for pattern, term in _NAMES.items() if pattern.search(words_of_it)), "")


def messages() -> Iterator[Page]:
    """Texts of four words and more in the packages' programs: errors, notes, help, headings; no command lines."""
    for file, tree in _trees():
        nodes = list(ast.walk(tree))
        skipped = {id(node.value) for node in nodes if isinstance(node, ast.Expr)}
        skipped |= {id(part) for node in nodes if isinstance(node, ast.JoinedStr) for part in node.values}
        for node in nodes:
            if id(node) in skipped or not isinstance(node, ast.Constant | ast.JoinedStr):
                continue
            text = "".join(_constant(part) for part in (node.values if isinstance(node, ast.JoinedStr) else [node]))
            if len(re.findall(r"[A-Za-z]{2,}", text)) >= 4 and " " in text and not text.startswith("validate "):
                yield Page(f"{_name(file)}:{node.lineno}", markdown(_plain(text)))


def templates() -> Iterator[Page]:
    """Templates of pages and of files that the packages ship."""
    for package in PACKAGES:
        for file in sorted((ROOT / package).rglob("templates/**/*")):
            if file.suffix in {".html", ".jinja", ".j2", ".md", ".toml"} and ".css" not in file.suffixes:
                text = file.read_text(encoding="utf-8")
                if file.suffix == ".toml":
                    text = "\n\n".join(re.findall(r"#\s*(.*)", text))
                text = re.sub(r"<(style|script)\b.*?</\1>|\{[%#].*?[%#]\}", "\n\n", text, flags=re.S)
                text = re.sub(r"</?(p|td|th|li|h\d|div|dt|dd|tr|figcaption|section)\b[^>]*>", "\n\n", text)
                text = re.sub(r"<code>.*?</code>|\{\{.*?\}\}", _CODE, text, flags=re.S)
                lines = re.sub(r"<[^>]*>", "", text).splitlines()
                yield Page(_name(file), markdown("\n".join(line.strip() for line in lines)))


def _files(folders: Sequence[str]) -> Iterator[Path]:
    """Programs."""
    for folder in folders:
        yield from sorted((ROOT / folder).rglob("*.py"))


def _trees() -> Iterator[tuple[Path, ast.Module]]:
    for package in PACKAGES:
        for file in sorted((ROOT / package).rglob("*.py")):
            yield file, parsed(file)


def _constant(node: ast.expr) -> str:
    if isinstance(node, ast.Constant):
        return node.value if isinstance(node.value, str) else ""
    return _CODE


def _plain(text: str) -> str:
    """reStructuredText as Markdown, as far as prose goes: code spans, roles, entries of Args; no examples."""
    text = re.sub(r"^\s*>>>.*?(?=^\s*$|\Z)", "", text, flags=re.MULTILINE | re.DOTALL)
    text = re.sub(r":[\w:]+:`[^`]*`", "`x`", text.replace("``", "`"))
    return re.sub(r"^\s+(\w+): ", r"\n\n`\1`: ", text, flags=re.MULTILINE)


def _name(file: Path) -> str:
    return file.relative_to(ROOT).as_posix()


SOURCES: dict[str, Callable[[], Iterator[Page]]] = {
    "pages": pages,
    "gallery": gallery,
    "docstrings": docstrings,
    "comments": comments,
    "messages": messages,
    "templates": templates,
}
"""Everything that is read, by name."""

if __name__ == "__main__":
    for name, source in SOURCES.items():
        read = list(source())
        offences = {page.name: found for page in read if (found := page.offences())}
        print(f"{name}: {sum(map(len, offences.values()))} offences in {len(offences)} of {len(read)}")
        if "-v" in sys.argv or name in sys.argv:
            for where, found in offences.items():
                print(*(f"  {where}: {line}" for line in found), sep="\n")
    print(*(f"{where}: {name}, say {in_name(name)}" for where, name in names()), sep="\n")
