"""What the page says of an answer, as HTML."""

from __future__ import annotations

from html import escape

import numpy as np

from vjm.tree.critical_force import Weakest
from vjm_validation.explore.state import ExplorerAnswer

BARS = 8
"""Parts that have a bar of their own."""
AXES = ("ux", "uy", "uz", "rx", "ry", "rz")


def numbers(answer: ExplorerAnswer, factor: float, seconds: float) -> str:
    """The answer as HTML; every number has an id of its own."""
    moved = "".join(
        f"<td>{name}</td><td id='{name}'>{value:.5g}</td>" + ("</tr><tr>" if k == 2 else "")
        for k, (name, value) in enumerate(zip(AXES, answer.deflection, strict=True))
    )
    shift = float(np.linalg.norm(answer.deflection[:3]))
    stiff = ", ".join("rigid" if not np.isfinite(v) else f"{v:.5g}" for v in answer.principal)
    frequency = "–" if answer.frequency is None else f"{answer.frequency:.5g} Hz"
    lines = [
        f"<div><b>deflection</b>, mm and rad</div><table style='width:100%'><tr>{moved}</tr></table>",
        f"<div>shift of the end <b id='shift'>{shift:.5g}</b> mm, drawn times {factor:.3g}</div>",
        f"<div>principal stiffnesses <b id='principal'>{stiff}</b> N/mm</div>",
        f"<div>first natural frequency <b id='frequency'>{frequency}</b></div>",
    ]
    if answer.shares is not None:
        lines.append(bars(answer))
    lines += [f"<div style='color:#666'>{escape(text)}</div>" for text in answer.said]
    lines.append(f"<div style='color:#888'>answered in <span id='time'>{1e3 * seconds:.0f}</span> ms</div>")
    return f"<div id='numbers' style='font-size:0.85em;padding:0 0.8em'>{''.join(lines)}</div>"


def bars(answer: ExplorerAnswer) -> str:
    """The parts' shares in the strain energy, the largest first, as bars."""
    assert answer.shares is not None
    pairs = sorted(zip(answer.shares.energies.tolist(), answer.shares.rows, strict=True), key=lambda pair: -pair[0])
    rows = [
        f"<tr><td>{escape(row.part)} ({row.kind})</td><td style='width:45%'><div style='background:#3c78be;"
        f"height:0.8em;width:{100.0 * max(share, 0.0):.1f}%'></div></td><td>{share:.1%}</td></tr>"
        for share, row in pairs[:BARS]
        if np.isfinite(share)
    ]
    rest = sum(share for share, _ in pairs[BARS:])
    if len(pairs) > BARS:
        rows.append(f"<tr><td>{len(pairs) - BARS} more</td><td></td><td>{rest:.1%}</td></tr>")
    head = "<tr><td colspan=3><b>shares in the strain energy</b></td></tr>"
    return f"<table id='shares' style='width:100%'>{head}{''.join(rows)}</table>"


def command_words(command: str, remark: str) -> str:
    """A command as HTML that one click marks as a whole, so that it can be copied."""
    code = f"<code id='command' style='user-select:all;overflow-wrap:anywhere'>{escape(command)}</code>"
    return f"<div style='padding:0 0.8em;font-size:0.85em'>{code}<div>{escape(remark)}</div></div>"


def critical_words(found: Weakest) -> str:
    """What a search for the smallest critical force says."""
    if not np.isfinite(found.force):
        return f"There is none: {found.why}." if found.why else "There is none."
    x, y, z = found.direction
    return f"Smallest critical force {found.force:.5g} N, along ({x:.3f}, {y:.3f}, {z:.3f})."


def remark(line: str, name: str, *, wrong: bool = False) -> str:
    """A line as HTML; nothing for no line.

    Args:
        line: on what was done, or why it was not.
        name: id of its element.
        wrong: whether something was refused, or failed.
    """
    style = f"color:{'#b00' if wrong else '#333'};padding:0 0.8em;font-size:0.85em;overflow-wrap:anywhere"
    return f'<div id="{name}" style="{style}">{escape(line)}</div>' if line else ""
