"""Mutations of a file: bytes, tokens, numbers, lines; each from a seed, so that a finding can be repeated."""

import re
from collections.abc import Callable

import numpy as np

NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
ODD_NUMBERS = (
    b"0", b"-1", b"1e308", b"-1e308", b"1e-320", b"nan", b"inf", b"-inf", b"1e999", b"999999999999999999999",
    b"0x10", b"1_0", b"true", b'"1.0"', b"[1.0]", b"[]", b"{}", b"''", "١٢".encode(), b"1,5",
)  # fmt: skip
ODD_TEXT = (
    b"\x00", b"\xff\xfe", b"\xef\xbb\xbf", b"\r", b"[" * 2000, b'"' * 3, b"<img src=x onerror=alert(1)>",
    "é\u202e\U0001f600".encode(), b"../../etc/passwd", b"%s%n", b"x" * 20000, b"#", b"=", b"\n[parts]\n",
    b"\na" + b".a" * 60000 + b" = 1\n", b"\n[" + b"a." * 5000 + b"a]\n",
)  # fmt: skip


def _bytes(raw: bytes, rng: np.random.Generator) -> bytes:
    out = bytearray(raw)
    for _ in range(int(rng.integers(1, 6))):
        out[int(rng.integers(len(out)))] = int(rng.integers(256))
    return bytes(out)


def _cut(raw: bytes, rng: np.random.Generator) -> bytes:
    a, b = sorted(int(v) for v in rng.integers(0, len(raw) + 1, 2))
    return raw[:a] + raw[b:]


def _repeat(raw: bytes, rng: np.random.Generator) -> bytes:
    a, b = sorted(int(v) for v in rng.integers(0, len(raw) + 1, 2))
    return raw[:b] + raw[a:b] * int(rng.integers(1, 4)) + raw[b:]


def _number(raw: bytes, rng: np.random.Generator) -> bytes:
    found = list(NUMBER.finditer(raw))
    if not found:
        return raw
    one = found[int(rng.integers(len(found)))]
    return raw[: one.start()] + ODD_NUMBERS[int(rng.integers(len(ODD_NUMBERS)))] + raw[one.end() :]


def _scale(raw: bytes, rng: np.random.Generator) -> bytes:
    """A number in another unit: well-formed, and wrong."""
    found = list(NUMBER.finditer(raw))
    if not found:
        return raw
    one = found[int(rng.integers(len(found)))]
    factor = 10.0 ** int(rng.integers(-9, 10)) * (-1.0) ** int(rng.integers(2))
    return raw[: one.start()] + repr(float(one.group()) * factor).encode() + raw[one.end() :]


def _text(raw: bytes, rng: np.random.Generator) -> bytes:
    at = int(rng.integers(len(raw) + 1))
    return raw[:at] + ODD_TEXT[int(rng.integers(len(ODD_TEXT)))] + raw[at:]


def _lines(raw: bytes, rng: np.random.Generator) -> bytes:
    lines = raw.split(b"\n")
    a, b = (int(v) for v in rng.integers(0, len(lines), 2))
    lines[a], lines[b] = lines[b], lines[a]
    if rng.random() < 0.5:
        lines.pop(a)
    return b"\n".join(lines)


def _encoding(raw: bytes, rng: np.random.Generator) -> bytes:
    text = raw.decode("utf-8", "replace")
    return text.encode(("utf-16", "latin-1", "utf-8-sig", "cp037")[int(rng.integers(4))], "replace")


MUTATIONS: tuple[Callable[[bytes, np.random.Generator], bytes], ...] = (
    _bytes, _cut, _repeat, _number, _scale, _text, _lines, _encoding,
)  # fmt: skip


def mutated(raw: bytes, seed: int) -> bytes:
    """One to three mutations of a file's bytes."""
    rng = np.random.default_rng(seed)
    for _ in range(int(rng.integers(1, 4))):
        if raw:
            raw = MUTATIONS[int(rng.integers(len(MUTATIONS)))](raw, rng)
    return raw
