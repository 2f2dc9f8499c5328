"""The calibrated machine as a model file that every command takes.

The parts that were looked for get what was found. A part has two descriptions, a section and a 6×6 compliance, of
which the springs use one. The other is changed alike, so that both go on describing one part. Where one factor says
all, it is that factor. A matrix beside a calibrated section changes as beam theory's matrix does. A section beside
a calibrated matrix changes by the four compliances that the matrix shows at the beam's middle.
"""

from __future__ import annotations

import copy
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from vjm.io.model_file import build_chain
from vjm.io.toml_text import parse_toml, toml_text
from vjm.model.joints import Joint
from vjm.model.machine import Machine
from vjm.model.parts import Beam, RigidOffset, Section
from vjm.rotations import Array, rotate_matrix6, shift_compliance
from vjm_updating.calibration.parameters import split_parts
from vjm_updating.constants import numerical
from vjm_updating.experiment import Measurement

ALIKE = numerical(1e-12)
"""Spread of factors below which they are one."""
_KEYS = {"EA": "EA_N", "GJ": "GJ_Nmm2", "EIy": "EIy_Nmm2", "EIz": "EIz_Nmm2", "GAy": "GAy_N", "GAz": "GAz_N"}


def calibrated_document(measurement: Measurement, chain: Machine, way: str = "calibrated") -> dict[str, Any]:
    """The model document of a machine that a test has changed.

    Args:
        measurement: whose document it begins from.
        chain: calibrated, see `vjm_updating.calibration.parameters.Unknowns.build`.
        way: in which it was changed: calibrated, or extended.
    """
    document = copy.deepcopy(measurement.document)
    split = split_parts(measurement.engine, measurement.chain)
    for table, old, new in zip(document["parts"], measurement.chain.parts, chain.parts, strict=True):
        if isinstance(new, Joint) and new is not old:
            _joint(table, new)
        elif isinstance(old, Beam) and isinstance(new, Beam):
            _beam(table, old, new, by_section=new.name in split)
            _beam_mass(table, old, new)
        elif isinstance(old, RigidOffset) and isinstance(new, RigidOffset) and new.mass != old.mass:
            _scale(table, ("mass_kg", "inertia_kg_mm2"), new.mass / old.mass)
    file, sheet = measurement.readings.file, measurement.sheet
    document["title"] = f"{document['title']}, {way}"
    document["source"] = f"{way} from {file} with {sheet.file}; nominal values: {document['source']}"
    return document


def calibrated_text(measurement: Measurement, chain: Machine) -> str:
    """The text of the model file.

    Raises:
        ValueError: the calibrated machine is not one that a model file admits.
    """
    document = calibrated_document(measurement, chain)
    file = measurement.readings.file
    try:
        build_chain(document, file)
    except ValueError as error:
        # its remedy is for a file that somebody wrote: place and value are the fit's
        _, *found = str(error).split(": ")
        raise ValueError(
            f"{file}: the fit takes the model beyond what a model file admits ({': '.join(found[:2])}). Look for a "
            "wrong unit or sign in the readings, or a support that the sheet does not name"
        ) from None
    return model_text(measurement, document)


def model_text(
    measurement: Measurement,
    document: dict[str, Any],
    notes: Sequence[str] = (),
    way: str = "Calibrated",
    command: str = "calibrate",
) -> str:
    """The text of a model file that follows from a test.

    Args:
        measurement: the test.
        document: of the model.
        notes: what is said of it.
        way: in which the model was changed.
        command: that did so.
    """
    by = f"{way} from {measurement.readings.file} with {measurement.sheet.file} by `validate {command}`."
    return comments((by, *notes)) + toml_text(document)


def comments(lines: Iterable[str]) -> str:
    """Lines at the head of a model file."""
    return "".join(f"# {line}\n" for line in lines)


def marked(text: str, reasons: Sequence[str], within: Mapping[str, Sequence[float]] | None = None) -> str:
    """The text of a model file that says why it is not for use, and within which ranges it is known.

    Args:
        text: with its head.
        reasons: none where it is for use.
        within: of joints by name, rad or mm.
    """
    if not reasons and not within:
        return text
    head = "".join(line for line in text.splitlines(keepends=True) if line.startswith("#"))
    document = parse_toml(text)
    table: dict[str, Any] = document.get("calibrated", {})
    if reasons:
        table["not_for_use"] = list(reasons)
    if within:
        table["valid_within"] = {joint: [float(v) for v in ends] for joint, ends in within.items()}
    document["calibrated"] = table
    return head + toml_text(document)


def not_for_use(reasons: Iterable[str]) -> list[str]:
    """Lines for the head of a model file that is written by force."""
    return [f"Not for use: {reason}; see calibration.json." for reason in reasons]


def xml_comments(lines: Iterable[str], text: str) -> str:
    """A text in XML with lines at its head, behind its declaration."""
    # two hyphens end a comment
    said = "".join(f"<!-- {line.replace('--', '- -')} -->\n" for line in lines)
    declared, _, rest = text.partition("?>\n")
    return f"{declared}?>\n{said}{rest}" if rest else said + text


def _joint(table: dict[str, Any], new: Joint) -> None:
    """What a joint has of compliances, in the keys of its kind."""
    if new.passive and not new.fixed:
        table["stiffness_N_per_mm" if new.slides else "stiffness_Nmm_per_rad"] = float(new.stiffness)
        return
    if new.compliance > 0.0:
        table["compliance_mm_per_N" if new.slides else "compliance_rad_per_Nmm"] = float(new.compliance)
    if any(new.lateral):
        table["lateral_rad_per_Nmm"] = [float(c) for c in new.lateral]


def _beam(table: dict[str, Any], old: Beam, new: Beam, *, by_section: bool) -> None:
    table["length_mm"] = float(new.length)
    section, compliance = new.section, new.compliance
    if old.section is not None and old.compliance is not None and compliance is not None:
        same_section, same_matrix = _factors(old.section, section) == [1.0] * 4, _same(old.compliance, compliance)
        if by_section and same_matrix and not same_section:
            compliance = _as_theory_changes(old, new)
        elif not by_section and same_section and not same_matrix:
            section = _softened_alike(old, compliance)
    if section is not None and old.section is not None:
        _write_section(table["section"], old.section, section)
    if compliance is not None and not _same(old.compliance, compliance):
        table["compliance"] = (0.5 * (compliance + compliance.T)).tolist()
        table["compliance_source"] = f"calibrated; before: {table.get('compliance_source', '')}"


def _beam_mass(table: dict[str, Any], old: Beam, new: Beam) -> None:
    """Write a beam's mass: another one, or where its section was a shape with a density and is none any more."""
    section = table.get("section", {})
    if "density_kg_per_m3" in section and old.section is not None and new.section is not None and old.mass:
        _scale(section, ("density_kg_per_m3",), new.section.mass / old.section.mass)
    elif new.mass and ("mass_kg" not in table or new.mass != old.mass):
        table["mass_kg"] = float(new.mass)


def _scale(table: dict[str, Any], keys: tuple[str, ...], by: float) -> None:
    """Multiply numbers of a table, or lists of them, that it has."""
    if abs(by - 1.0) < ALIKE:
        return
    for key in keys:
        if key in table:
            value = table[key]
            table[key] = [by * float(one) for one in value] if isinstance(value, list) else by * float(value)


def _same(a: Array | None, b: Array | None) -> bool:
    return a is None or b is None or np.array_equal(a, b)


def _factors(old: Section, new: Section | None) -> list[float]:
    """What axial stiffness, torsion and the two bendings were multiplied by."""
    names = ("EA", "GJ", "EIy", "EIz")
    return [1.0 if new is None else float(getattr(new, name) / getattr(old, name)) for name in names]


def _as_theory_changes(old: Beam, new: Beam) -> Array:
    """The matrix congruent to the old one as beam theory's new matrix is to its old one ``(6, 6)``."""
    assert old.compliance is not None
    before, after = old.beam_compliance(), new.beam_compliance()
    size = 1.0 / np.sqrt(np.diag(before))
    L, M, N = (np.linalg.cholesky(size[:, None] * C * size) for C in (old.compliance / old.count, before, after))
    change = np.linalg.solve(M, N)
    root = (L @ change) / size[:, None]
    result: Array = root @ root.T * old.count
    return result


def _softened_alike(beam: Beam, compliance: Array) -> Section:
    """The section with the softness about each of its axes that a matrix has at the beam's middle."""
    assert beam.section is not None
    assert beam.compliance is not None

    def at_middle(C: Array) -> Array:
        middle = -beam.end_offset - beam.section_frame @ np.array([0.5 * beam.length, 0.0, 0.0])
        result: Array = np.diag(rotate_matrix6(shift_compliance(C, middle), beam.section_frame.T))
        return result

    softer = at_middle(compliance) / at_middle(beam.compliance)
    s = beam.section
    return Section(
        s.EA / softer[0], s.GJ / softer[3], s.EIy / softer[4], s.EIz / softer[5], s.GAy / softer[1],
        s.GAz / softer[2], s.mass,
    )  # fmt: skip


def _write_section(table: dict[str, Any], old: Section, new: Section) -> None:
    """A section's new values; one that is a shape stays so where one modulus says all."""
    factors = _factors(old, new)
    if factors == [1.0] * 4:
        return
    before = table.get("source", "")
    if "shape" in table and max(factors) - min(factors) < ALIKE:
        for key in ("youngs_modulus_MPa", "shear_modulus_MPa"):
            if key in table:
                table[key] = float(table[key] * factors[0])
    else:
        # a shape's other values, such as its yield stress, do not fit a section known by its stiffness
        kept = {} if "shape" in table else {k: v for k, v in table.items() if k not in _KEYS.values()}
        values = {key: float(getattr(new, name)) for name, key in _KEYS.items()}
        table.clear()
        table.update(kept | {key: value for key, value in values.items() if np.isfinite(value)})
    table["source"] = f"calibrated; before: {before}"
