"""The machine with what was found as a model file that every command takes.

It is calibrated, or extended by the causes that act.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from vjm.io.files import parse_toml, toml_text
from vjm.io.model_file import build_chain
from vjm.model.laws import Tabulated
from vjm.model.machine import Machine
from vjm.model.parts import Beam, Joint, JointKind, RigidOffset, Section
from vjm.rotations import Array, rotate_matrix6, shift_compliance
from vjm_updating.calibration.parameters import split_parts
from vjm_updating.constants import numerical
from vjm_updating.diagnosis.column import ColumnYield
from vjm_updating.diagnosis.document import ValueRow
from vjm_updating.experiment import Measurement
from vjm_updating.inference.fitting import Fit, LeastSquaresProblem
from vjm_updating.inference.instruments import InstrumentScale, InstrumentZero, ThermalDrift
from vjm_updating.inference.joint_forward import JointThreeSlopes
from vjm_updating.mechanisms.contacts import ContactCompliance
from vjm_updating.mechanisms.drives import ActuatorCompliance, InDrive, compliance_of
from vjm_updating.mechanisms.effect import Effect, drive, part_table
from vjm_updating.mechanisms.loads import Gravity, LoadMisalignment
from vjm_updating.mechanisms.modified_chain import STANDARD_GRAVITY, ModifiedMachine, beam_of
from vjm_updating.mechanisms.series_elements import AtJoint, Memoryless, SeriesElement
from vjm_updating.mechanisms.structure import (
    BaseCompliance,
    FootLumping,
    LinkBow,
    LinkLength,
    LinkLumping,
    PartCompliance,
)

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
        _, *parts = str(error).split(": ")
        raise ValueError(
            f"{file}: the fit takes the model beyond what a model file admits ({': '.join(parts[:2])}). Look for a "
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


def model_files(
    texts: Mapping[str, str], reasons: Sequence[str], within: Mapping[str, Sequence[float]] | None = None,
    notes: Sequence[str] = (), *, force: bool = False,
) -> dict[str, str]:  # fmt: skip
    """Texts of model files by name, TOML or XML, with what is said of them at their heads.

    For ``reasons`` and ``within`` see `marked`; ``notes`` are further lines. What is not for use is empty, unless
    it is written by ``force``.
    """
    if reasons and not force:
        return dict.fromkeys(texts, "")
    said = [*(f"Not for use: {reason}; see calibration.json." for reason in reasons), *notes]
    return {
        name: marked(comments(said) + text, reasons, within) if name.endswith(".toml") else xml_comments(said, text)
        for name, text in texts.items()
    }


def xml_comments(lines: Iterable[str], text: str) -> str:
    """A text in XML with lines at its head, behind its declaration."""
    # two hyphens end a comment
    said = "".join(f"<!-- {line.replace('--', '- -')} -->\n" for line in lines)
    declared, _, rest = text.partition("?>\n")
    return f"{declared}?>\n{said}{rest}" if rest else said + text


def _joint(table: dict[str, Any], new: Joint) -> None:
    """What a joint has of compliances, in the keys of its kind."""
    if new.law is not None:
        table["law"] = new.law.table(slides=new.slides)
    elif new.passive and not new.fixed:
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
    return root @ root.T * old.count


def _softened_alike(beam: Beam, compliance: Array) -> Section:
    """The section with the softness about each of its axes that a matrix has at the beam's middle."""
    assert beam.section is not None
    assert beam.compliance is not None

    def at_middle(C: Array) -> Array:
        middle = -beam.end_offset - beam.section_frame @ np.array([0.5 * beam.length, 0.0, 0.0])
        return np.diag(rotate_matrix6(shift_compliance(C, middle), beam.section_frame.T))

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


FILE = "extended-model.toml"
WORDS: dict[type[Effect], str] = {
    ActuatorCompliance: "in the drive's compliance",
    JointThreeSlopes: "in the joint's law",
    BaseCompliance: "in the mounts before the chain",
    PartCompliance: "in the part's section and matrix",
    LinkLength: "in the link's length_mm",
    LinkBow: "in the link's bow_mm",
    Gravity: "in the link's mass_kg; it weighs where a command says --gravity",
    LinkLumping: "in link_segments",
    FootLumping: "in foot_segments",
    ColumnYield: "in the section's yield_stress_MPa; springs stay elastic beyond it, so the numbers below hold up "
    "to it",
}
"""Causes that the file's values express, and where."""
ERRORS = (InstrumentZero, InstrumentScale, ThermalDrift)
IN_JOINTS = (InDrive, ContactCompliance)
"""What may sit in a joint's drive."""
OWN_NUMBERS = (ActuatorCompliance, JointThreeSlopes)
"""What a file says of a joint by numbers of its own, where nothing else sits in that joint."""
SHARES = numerical(np.geomspace(1e-4, 1.0, 40))
"""Of a test's largest load, at which a law is written: neighbours are a quarter apart."""
TABLE_ERROR, REFINED = numerical(1e-5), numerical(8)
"""Of the range of its deflections, by which a table may miss a law; and how often its pairs are halved for that."""
SPRING_KEYS = ("compliance_rad_per_Nmm", "compliance_mm_per_N", "stiffness_Nmm_per_rad", "stiffness_N_per_mm")
"""Of a joint's table, in whose place its law is."""


def extended_chain(fitter: LeastSquaresProblem, fit: Fit) -> Machine:
    """The chain as the extended file has it, its machine's nuisances included."""
    measurement = fitter.forward.observed.measurement
    return build_chain(extended_document(measurement, fitter, fit), FILE)


def extended_document(
    measurement: Measurement,
    fitter: LeastSquaresProblem,
    fit: Fit,
    way: str = "extended",
    needless: Collection[str] = (),
) -> dict[str, Any]:
    """The model document of a fit's machine.

    Args:
        measurement: the test.
        fitter: of it.
        fit: of a hypothesis.
        way: in which the model was changed.
        needless: labels of effects that the readings do not need, see `joint_laws`.

    Raises:
        ValueError: the machine is not one that a model file admits.
    """
    machine: ModifiedMachine = fitter.forward.machine(fit.parameters, fit.evaluation.z, fit.hypothesis)
    springs = replace(machine, bow=(), asymmetry=(), weight=()).chain()
    document = calibrated_document(measurement, springs, way)
    if not fit.hypothesis:
        document["title"] = measurement.document["title"]
    engine = machine.engine
    document["springs"] = {"link_segments": engine.segments or 1, "foot_segments": engine.foot_segments or 1}
    for name, along_y, along_z in machine.bow:
        y, z = beam_of(machine.nominal, name).bow
        part_table(document, name)["bow_mm"] = [float(y + along_y), float(z + along_z)]
    for name, mass in machine.weight:
        part = part_table(document, name)
        part["mass_kg"] = float(mass)
        part.get("section", {}).pop("density_kg_per_m3", None)
    laws = joint_laws(fitter, fit, needless)
    for effect, values in zip(fit.hypothesis, fit.values, strict=True):
        if laws.keys().isdisjoint(sites(effect, values, machine)):
            effect.write(document, machine.nominal, values)
    for name, law in laws.items():
        table = part_table(document, name)
        for key in SPRING_KEYS:
            table.pop(key, None)
        table["law"] = law
    build_chain(document, FILE)
    return document


Placed = tuple[InDrive | ContactCompliance, float, SeriesElement]
"""An effect in a joint, the lever in mm at which it sits there, and what it does."""


def sites(
    effect: Effect, values: Sequence[float], machine: ModifiedMachine
) -> dict[str, tuple[float, SeriesElement]]:
    """What of an effect sits in joints and has no history, by the joint's name, and the lever at which it does.

    The lever is in mm, and 1 in what slides. A drive before all joints is the actuator, where there is one alone.
    """
    if not isinstance(effect, IN_JOINTS):
        return {}
    actuators = [p.name for p in machine.nominal.parts if isinstance(p, Joint) and p.kind is JointKind.ACTUATOR]
    result = {}
    for element in effect.elements(machine, values):
        if not isinstance(element.law, Memoryless):
            continue
        if isinstance(element.place, AtJoint):
            result[element.place.joint] = element.place.lever, element
        elif len(actuators) == 1 and machine.drive_axis is not None and element.place == drive(machine):
            result[actuators[0]] = 1.0, element
    return result


def joint_laws(fitter: LeastSquaresProblem, fit: Fit, needless: Collection[str] = ()) -> dict[str, dict[str, Any]]:
    """Tables of laws by joints: the joint's spring, and in series with it all of a fit that has no history.

    A joint has none where its own numbers say it, see `OWN_NUMBERS`, and where no law does. None does beside a 6×6,
    unless the joint has a law already, nor where the deflection does not grow with the load, as behind a free
    travel with rigid ends. A law is known up to the largest load of the test. It counts from where the joint stands
    unloaded. Effects that are ``needless``, by their labels, are not in it; a spring that is needless in the place
    of the joint's own is a straight one.
    """
    machine: ModifiedMachine = fitter.forward.machine(fit.parameters, fit.evaluation.z, fit.hypothesis)
    in_series: dict[str, list[Placed]] = {}
    for effect, values in zip(fit.hypothesis, fit.values, strict=True):
        if not isinstance(effect, IN_JOINTS) or (effect.label in needless and not effect.in_place_of):
            continue
        for name, (lever, element) in sites(effect, values, machine).items():
            in_series.setdefault(name, []).append((effect, lever, element))
    result = {}
    for name, own in in_series.items():
        joint = next(p for p in machine.nominal.parts if isinstance(p, Joint) and p.name == name)
        straight = all(isinstance(e, OWN_NUMBERS) or e.label in needless for e, _, _ in own)
        replaced = any(effect.in_place_of == name for effect, _, _ in own)
        whole = joint.matrix is not None and joint.law is None
        if whole or (len(own) == 1 and straight and (joint.law is None or replaced)):
            continue
        lever = own[0][1]
        force = max(e.drive.force if isinstance(e, InDrive) else e.force for e, _, _ in own)
        if (law := tabulated(partial(_deflection, joint, own, replaced), force * lever)) is not None:
            result[name] = law.table(slides=joint.slides)
    return result


def _deflection(joint: Joint, own: Sequence[Placed], replaced: bool, loads: Array) -> Array:
    """What a joint turns or slides by under ``loads`` (n,), its own spring ``replaced`` by what it has or not."""
    if joint.law is None or replaced:
        u = compliance_of(joint) * loads
    else:
        u = np.array([joint.law.deflection(load) for load in loads.tolist()])
    for _, lever, element in own:
        assert isinstance(element.law, Memoryless)
        u = u + element.law.function(loads / lever)[0] / lever
    return u


def tabulated(deflection: Callable[[Array], Array], most: float) -> Tabulated | None:
    """The law of deflections by loads ``(n,)``, from no load on; None where they do not grow with the load.

    It is known up to ``most``. There are pairs at `SHARES` of that, and between them where it would else err by
    more than `TABLE_ERROR`.
    """
    loads = most * np.concatenate([-SHARES[::-1], [0.0], SHARES])
    for _ in range(REFINED):
        u = deflection(loads)
        rest = float(u[loads == 0.0][0])
        u = u - rest
        if not (np.diff(u) > 0.0).all():
            return None
        law = Tabulated(tuple(map(float, u)), tuple(map(float, loads)))
        between = 0.5 * (loads[1:] + loads[:-1])
        exact = deflection(between) - rest
        off = np.abs(law.force(exact) - between) / np.maximum(law.tangent(exact), 1e-300)
        poor = off > TABLE_ERROR * float(np.ptp(u))
        if not poor.any():
            break
        loads = np.sort(np.concatenate([loads, between[poor]]))
    return law


def extended_text(
    measurement: Measurement, fitter: LeastSquaresProblem, fit: Fit, verdict: str, estimates: Mapping[str, ValueRow]
) -> str:
    """The text of the model file.

    Raises:
        ValueError: the machine is not one that a model file admits.
    """
    document = extended_document(measurement, fitter, fit)
    notes = [f"Verdict: {verdict}.", *_causes(fitter, fit, estimates)]
    return model_text(measurement, document, notes, "Extended", "diagnose")


def _causes(fitter: LeastSquaresProblem, fit: Fit, estimates: Mapping[str, ValueRow]) -> list[str]:
    machine: ModifiedMachine = fitter.forward.machine(fit.parameters, fit.evaluation.z, fit.hypothesis)
    laws, lines = joint_laws(fitter, fit), []
    for effect, values in zip(fit.hypothesis, fit.values, strict=True):
        own = ", ".join(
            f"{name.partition('.')[2]} = {e.words}"
            for name, e in estimates.items()
            if name.startswith(f"{effect.cause}.")
        )
        said = f"{effect.label}: {own}; " if own else f"{effect.label}: "
        inside = [name for name in sites(effect, values, machine) if name in laws]
        where = f"in the law of {', '.join(inside)}" if inside else _where(effect, values, machine)
        lines.append(f"{said}{where}.")
    return lines


def _where(effect: Effect, values: Sequence[float], machine: ModifiedMachine) -> str:
    """Where an effect is in the file, or why it is not."""
    words = next((words for kind, words in WORDS.items() if isinstance(effect, kind)), "")
    if isinstance(effect, Gravity):
        g = ",".join(f"{STANDARD_GRAVITY * v:.6g}" for v in machine.gravity)
        return f"{words} {g}"
    if isinstance(effect, LoadMisalignment):
        tilted = effect.tilted(values)
        return f"of the test, not of the machine: a command says --axis {','.join(f'{v:.6g}' for v in tilted)}"
    if isinstance(effect, ActuatorCompliance) and not effect.is_written(machine.nominal, values):
        return (
            "not in the numbers below: the joint's matrix is rigid askew to its axis, or one of several drives "
            "has a law"
        )
    if not words and sites(effect, values, machine):
        return "not in the numbers below: the joint has a 6×6 compliance, or stops at an end that no law has"
    if isinstance(effect, ERRORS):
        return "an error of the instrument, not in the numbers below"
    return words or "not in the numbers below: a chain of springs has no word for it"
