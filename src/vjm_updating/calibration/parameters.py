"""What a calibration looks for: parameters of the machine, and the nuisances of the test beside them.

Also the machine that their values mean, for any forward model.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from vjm.engines import VjmEngine
from vjm.io.errors import did_you_mean
from vjm.model.machine import Machine
from vjm.model.parameters import SECTION_VALUES, Parameter, beam_length
from vjm.model.parts import Beam, Joint, Part, RigidOffset
from vjm.rotations import Array
from vjm_updating.constants import definition, physical_bound, prior_scale
from vjm_updating.experiment import Kind, Nuisance
from vjm_updating.inference.parameters import FitParameter, Hypothesis
from vjm_updating.mechanisms.modified_chain import ModifiedMachine, beam_of

WEAK = prior_scale(1.0)
"""Standard deviation of the prior on a parameter's z: a factor of e. It only holds what the data do not see."""
SOFT_DRIVE = prior_scale(1e-5)
"""Unit of a nominally rigid drive's compliance, mm/N: a thirtieth of the paper's foot."""
RIGID = physical_bound(1e-4)
"""Smallest z of such a drive: its coordinate must not vanish."""
MATRIX = definition(tuple((i, j) for i in range(6) for j in range(i + 1)))
"""Entries of the triangular factor, row by row."""
SECTION = ("EA", "GJ", "EIy", "EIz")
MASS = "mass"
"""Of a rigid link, a payload or a beam, its moments of inertia with it; of no meaning where nothing vibrates."""
ABOUT = ("compliance", "lateral-1", "lateral-2")
"""Compliances of a joint: about or along its own axis, and about the two `vjm.model.parts.joint_axes` across."""


@dataclass(frozen=True)
class CalibrationParameter(FitParameter):
    """A parameter of the machine that a calibration looks for; its prior has the mean zero in z.

    Attributes:
        name: ``link.EIz``, ``foot.factor``, ``actuator.compliance``, ``foot.R21``.
        unit: of its value.
        linear: whether the value is ``nominal + scale z``, and not ``nominal · exp(z)``.
        difference: a ten-thousandth of a stiffness.
    """

    difference = 1e-4

    unit: str = "1"
    nominal: float = 1.0
    linear: bool = False

    def value(self, z: float) -> float:
        """The quantity itself, in its unit."""
        return super().value(z) if self.linear else self.nominal * float(np.exp(z))

    def slope(self, z: float) -> float:
        """Derivative of the value by z."""
        return self.scale if self.linear else self.value(z)

    def coordinate(self, value: float) -> float:
        """The converse of `value`."""
        return super().coordinate(value) if self.linear else float(np.log(value / self.nominal))


Change = Callable[[Machine, Array], Machine]
"""Makes a machine from another and the coordinates of one block."""


@dataclass(frozen=True)
class Unknowns:
    """All coordinates of a calibration, parameters first, and the machine that each value of them means.

    Attributes:
        chain: the nominal machine.
        engine: of the lumped model.
        sought: the parameters.
        nuisances: of the test.
        changes: what blocks of them, each ``(first, last + 1)``, do to it.
    """

    chain: Machine
    engine: VjmEngine
    sought: tuple[CalibrationParameter, ...]
    nuisances: tuple[FitParameter, ...]
    changes: tuple[tuple[int, int, Change], ...]

    def __len__(self) -> int:
        return len(self.all)

    @property
    def all(self) -> tuple[FitParameter, ...]:
        """The coordinates."""
        return (*self.sought, *self.nuisances)

    @property
    def parameters(self) -> int:
        """Number of them."""
        return len(self.sought)

    @property
    def on_chain(self) -> np.ndarray:
        """Indices of those that change the chain."""
        return np.flatnonzero([not c.of_instrument for c in self.all])

    @property
    def sigma(self) -> Array:
        """Standard deviations of the priors ``(n,)``."""
        return np.array([c.sigma for c in self.all])

    @property
    def lowest(self) -> Array:
        """Bounds ``(n,)``."""
        return np.array([c.low for c in self.all])

    @property
    def start(self) -> Array:
        """Where a fit begins ``(n,)``: nominal, and a drive a little off its bound."""
        return np.maximum(0.0, self.lowest * 10.0)

    def build(self, z: Array) -> Machine:
        """The chain at the coordinates ``(n,)``."""
        chain = self.chain
        for first, last, change in self.changes:
            chain = change(chain, z[first:last])
        return chain

    def sensitivity_parameters(self, z: Array) -> list[Parameter]:
        """The coordinates that change the chain, at ``z`` (n,), as `vjm.design.critical.event_rates` takes them."""

        def parameter(i: int) -> Parameter:
            def apply(_: Machine, value: float) -> Machine:
                moved = z.copy()
                moved[i] = value
                return self.build(moved)

            return Parameter(self.all[i].name, "1", float(z[i]), 1.0, apply)

        return [parameter(i) for i in self.on_chain]


def split_parts(engine: VjmEngine, chain: Machine) -> set[str]:
    """Names of the beams whose section counts, because the engine splits them; of the others the 6×6 does."""
    names = {beam.name for beam in chain.beams if beam.compliance is None}
    return names | {beam.name for beam in engine.split(chain).beams if beam.segments is not None}


def default_parameters(engine: VjmEngine, chain: Machine) -> list[str]:
    """One factor for every beam, and the compliance of every drive, mount and joint that has one."""
    driven = (p for p in chain.parts if isinstance(p, Joint) and p.sprung)
    return [*(f"{beam.name}.factor" for beam in chain.beams), *(f"{part.name}.{ABOUT[0]}" for part in driven)]


def unknowns(
    chain: Machine, engine: VjmEngine, names: Sequence[str], extra: Sequence[Nuisance], *, masses: bool = False
) -> Unknowns:
    """The coordinates of a calibration.

    Args:
        chain: the nominal machine.
        engine: whose springs decide whether a part's section or its 6×6 counts.
        names: parameters as ``part.what``. Of a part: ``factor``; ``EA``, ``GJ``, ``EIy``, ``EIz``, ``GAy``,
            ``GAz`` or all of the first four as ``section``; ``C11`` to ``C66`` (a row and column of the 6×6 scaled,
            with its diagonal entry) or ``diagonal``; the full 6×6 as ``matrix``. Drives, mounts and
            joints have ``compliance``. Of a joint: ``lateral-1`` and ``lateral-2``. With ``masses`` what has a mass
            has ``mass``.
        extra: the sheet's nuisances. A modulus acts on what of its part is not looked for itself, and drops out
            where nothing is left.
        masses: whether masses can be looked for: where something vibrates.

    Raises:
        ValueError: a name means nothing, or two mean the same.
    """
    split = split_parts(engine, chain)
    sought: list[CalibrationParameter] = []
    nuisances: list[FitParameter] = []
    changes: list[tuple[int, int, Change]] = []
    taken: dict[str, set[str]] = {}
    for name in _spelt_out(names):
        part_name, _, what = name.partition(".")
        part = _part(chain, part_name, masses=masses)
        mine = taken.setdefault(part_name, set())
        for one in _meant(what, part, split):
            if one in mine:
                raise ValueError(f"parameter '{name}': {part_name}'s {one} is looked for twice: name it once")
            mine.add(one)
        if what == MASS and not masses:
            raise ValueError(f"parameter '{name}': a mass is looked for in a test of frequencies only")
        block, change = _block(name, part, what, split, chain.characteristic_length)
        changes.append((len(sought), len(sought) + len(block), change))
        sought += block
    for nuisance in extra:
        own = FitParameter(nuisance.name, nuisance.kind, nuisance.subject, nuisance.sigma)
        index = len(sought) + len(nuisances)
        if nuisance.kind is Kind.MODULUS:
            part = _part(chain, nuisance.subject)
            left = _counting(part, split) - taken.get(nuisance.subject, set())
            if not left or not isinstance(part, Beam):
                continue
            changes.append((index, index + 1, _modulus(part, left, own, whole=left == _counting(part, split))))
        elif nuisance.kind is Kind.LENGTH:
            changes.append((index, index + 1, _length(own)))
        elif nuisance.kind is Kind.MASS:
            if MASS in taken.get(nuisance.subject, set()):
                continue
            changes.append((index, index + 1, _mass(own.subject, own)))
        nuisances.append(own)
    return Unknowns(chain, engine, tuple(sought), tuple(nuisances), tuple(changes))


def _spelt_out(names: Sequence[str]) -> list[str]:
    groups = {"section": SECTION, "diagonal": tuple(f"C{i}{i}" for i in range(1, 7))}
    split = (name.partition(".") for name in names)
    return [f"{part}.{one}" for part, _, what in split for one in groups.get(what, (what,))]


def _part(chain: Machine, name: str, *, masses: bool = False) -> Part:
    rigid = () if masses else (RigidOffset,)
    parts = {p.name: p for p in chain.parts if not isinstance(p, rigid) and not (isinstance(p, Joint) and p.free)}
    if name not in parts:
        kind = "part" if masses else "elastic part"
        raise ValueError(
            f"parameter of '{name}': {chain.name} has no such {kind}"
            f"{did_you_mean(name, parts)}; it has {', '.join(parts)}"
        )
    return parts[name]


def _meant(what: str, part: Part, split: set[str]) -> set[str]:
    """The single values that a name stands for."""
    if not isinstance(part, Beam):
        return {what}
    if what in ("factor", "matrix"):
        return set(SECTION_VALUES) if part.name in split else {f"C{i}{i}" for i in range(1, 7)}
    return {what}


def _counting(part: Part, split: set[str]) -> set[str]:
    """The values of a beam that count: an infinite stiffness has no factor."""
    section = part.section if isinstance(part, Beam) else None
    return {
        one
        for one in _meant("factor", part, split)
        if one not in SECTION_VALUES or (section is not None and np.isfinite(getattr(section, one)))
    }


def _unknown(name: str, unit: str, nominal: float) -> CalibrationParameter:
    return CalibrationParameter(
        name, "parameter", name.partition(".")[0], 1.0, sigma=WEAK, unit=unit, nominal=nominal
    )


def _block(
    name: str, part: Part, what: str, split: set[str], length: float
) -> tuple[list[CalibrationParameter], Change]:
    """The coordinates of one name and what they do."""
    if isinstance(part, Joint):
        return _softness(name, part, what, length)
    if what == MASS:
        if not part.mass:
            raise ValueError(
                f"parameter '{name}': {part.name} has no mass in the model: give it one, a first guess"
            )
        return [_unknown(name, "kg", part.mass)], _mass(part.name)
    if isinstance(part, RigidOffset):
        raise ValueError(f"parameter '{name}': {part.name} is rigid: it has the parameter {part.name}.{MASS}")
    if what == "factor":
        scaled = _meant("factor", part, split)
        return [_unknown(name, "1", 1.0)], lambda chain, z: _with(
            chain, _softened(beam_of(chain, part.name), scaled, float(np.exp(z[0])), both=True)
        )
    if part.name in split:
        if what not in SECTION_VALUES:
            raise ValueError(
                f"parameter '{name}': {part.name} is split into springs with its section: "
                f"look for factor, section, {', '.join(SECTION_VALUES)}"
            )
        section = part.section
        value = float("inf") if section is None else float(getattr(section, what))
        if not np.isfinite(value):
            raise ValueError(
                f"parameter '{name}': shear is neglected in {part.name}: give the model file its {what}"
            )
        unit = "N mm²" if what in ("GJ", "EIy", "EIz") else "N"
        return [_unknown(name, unit, value)], lambda chain, z: _with(
            chain, _softened(beam_of(chain, part.name), {what}, float(np.exp(-z[0])))
        )
    if what == "matrix":
        ones = [_unknown(f"{part.name}.R{i + 1}{j + 1}", "1", 1.0) for i, j in MATRIX]
        block = [own if i == j else replace(own, nominal=0.0, linear=True)
                 for own, (i, j) in zip(ones, MATRIX, strict=True)]  # fmt: skip
        return block, _matrix(part)
    if not re.fullmatch(r"C([1-6])\1", what):
        raise ValueError(
            f"parameter '{name}': {part.name} is one spring with a 6×6: it has factor, diagonal, C11 to C66, matrix"
        )
    i = int(what[1]) - 1
    assert part.compliance is not None
    unit = "mm/N" if i < 3 else "rad/(N mm)"
    return [_unknown(name, unit, float(part.compliance[i, i]))], lambda chain, z: _with(
        chain, _softened(beam_of(chain, part.name), {what}, float(np.exp(z[0])))
    )


def _softened(beam: Beam, names: set[str], factor: float, *, both: bool = False) -> Beam:
    """A beam with some of its section's stiffnesses over a factor, and rows of its 6×6 times it.

    ``both`` scales the section and the whole 6×6, whichever counts, so that they go on describing one part.
    """
    section, compliance = beam.section, beam.compliance
    if section is not None:
        kept = SECTION_VALUES if both else [name for name in names if name in SECTION_VALUES]
        section = replace(section, **{name: getattr(section, name) / factor for name in kept})
    if compliance is not None:
        rows = [both or f"C{i}{i}" in names for i in range(1, 7)]
        root = np.where(rows, np.sqrt(factor), 1.0)
        compliance = root[:, None] * compliance * root
    return replace(beam, section=section, compliance=compliance)


def _modulus(part: Beam, names: set[str], own: FitParameter, *, whole: bool) -> Change:
    def change(chain: Machine, z: Array) -> Machine:
        factor = 1.0 / (1.0 + own.value(float(z[0])))
        return _with(chain, _softened(beam_of(chain, part.name), names, factor, both=whole))

    return change


def _matrix(part: Beam) -> Change:
    assert part.compliance is not None
    L = np.linalg.cholesky(part.compliance)

    def change(chain: Machine, z: Array) -> Machine:
        R = np.zeros((6, 6))
        for (i, j), value in zip(MATRIX, z, strict=True):
            R[i, j] = np.exp(value) if i == j else value
        root = L @ R
        return _with(chain, replace(beam_of(chain, part.name), compliance=root @ root.T))

    return change


def _mass(name: str, own: FitParameter | None = None) -> Change:
    """Mass and moments of inertia of a part times exp(z), or one plus a nuisance."""

    def change(chain: Machine, z: Array) -> Machine:
        by = float(np.exp(z[0])) if own is None else 1.0 + own.value(float(z[0]))
        part = next(p for p in chain.parts if p.name == name)
        if isinstance(part, RigidOffset):
            inertia = None if part.inertia is None else by * part.inertia
            # where it lies does not follow from how heavy it is
            return _with(chain, replace(part, mass=by * part.mass, inertia=inertia, centre=part.centre_of_mass))
        assert isinstance(part, Beam)
        section = None if part.section is None else replace(part.section, mass=by * part.section.mass)
        return _with(chain, replace(part, section=section, own_mass=by * part.own_mass))

    return change


def _length(own: FitParameter) -> Change:
    def change(chain: Machine, z: Array) -> Machine:
        length = beam_length(chain, own.subject)
        return length.apply(chain, length.value + own.value(float(z[0])))

    return change


def _softness(name: str, part: Joint, what: str, length: float) -> tuple[list[CalibrationParameter], Change]:
    """The coordinate of one spring's compliance; a rigid one's unit is `SOFT_DRIVE`, at the ``length``."""
    if part.matrix is not None and part.law is None:
        raise ValueError(f"parameter '{name}': {part.name} has a whole 6×6, which is not looked for")
    known = ABOUT[:1] if part.passive or part.fixed or part.matrix is not None else ABOUT
    if what not in known:
        raise ValueError(
            f"parameter '{name}': {part.name} has the parameters {', '.join(f'{part.name}.{k}' for k in known)}"
        )
    which = ABOUT.index(what)
    slides, nominal = part.slides and which == 0, part.compliances[which]
    own = _unknown(name, "mm/N" if slides else "rad/(N mm)", nominal)
    if nominal == 0.0:
        own = replace(own, scale=SOFT_DRIVE / (1.0 if slides else length**2), low=RIGID, linear=True)

    def change(chain: Machine, z: Array) -> Machine:
        now = next(p for p in chain.parts if p.name == part.name)
        assert isinstance(now, Joint)
        return _with(chain, now.with_compliance(which, own.value(float(z[0]))))

    return [own], change


def _with(chain: Machine, changed: Part) -> Machine:
    """The chain with the part of this name replaced."""
    return replace(chain, parts=tuple(changed if part.name == changed.name else part for part in chain.parts))


@dataclass
class OfUnknowns:
    """The machine of a forward model whose parameters are looked for.

    Attributes:
        unknowns: parameters of the machine and nuisances of the test.
    """

    unknowns: Unknowns = field(kw_only=True)

    def machine(self, unknowns: Sequence[FitParameter], z: Array, hypothesis: Hypothesis) -> ModifiedMachine:
        """The chain that the unknowns ``(n_z,)`` mean."""
        changed = tuple(z[self.unknowns.on_chain].tolist())
        return ModifiedMachine(self.unknowns.build(z), self.unknowns.engine, changed=changed)
