"""What was hidden in a set and what was found in it, in one form for all generators of sets."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from hidden_effects.judging import admitted, candidate_sets
from hidden_effects.plan import STRONG

STANDS_FOR = {"joint_offset": "frame_error"}
"""Causes of tests of poses that count as another one: errors of frames have offsets among them."""


@dataclass(frozen=True)
class Truth:
    """What a set hides.

    Attributes:
        generator: that made it.
        name: of the set.
        group: quiet, single, pair, outside, or inseparable (one cause, which the design cannot tell from another).
        causes: that act, of the catalogue.
        strength: of the weakest; None where the generator has none.
        alike: sets of causes that a set with a cause outside the catalogue may be told as.
        also: causes by which what is hidden may be told, and which are not wrong.
        parameters: true values by the key of `docs/measured-data.md`, of those that the generator has.
    """

    generator: str
    name: str
    group: str
    causes: frozenset[str]
    strength: float | None = None
    alike: frozenset[frozenset[str]] = frozenset()
    also: frozenset[str] = frozenset()
    parameters: Mapping[str, float] = field(default_factory=dict)

    @property
    def may(self) -> frozenset[str]:
        """Causes that are not wrong."""
        return self.causes | self.also


@dataclass(frozen=True)
class Found:
    """What a diagnosis says.

    Attributes:
        verdict: its word.
        probability: that it acts, by cause; of causes from 0.05 on, as the document has them.
        share: of what the nominal model misses, by cause; those of which it is known.
        acts: causes that are said to act.
        groups: causes of which one is said to act.
        named: sets of causes that remain possible; where there is none, what changed in the course of the file.
        intervals: of parameters, 95 %.
        seconds: of a processor.
        error: why there is no answer; empty where there is one.
    """

    verdict: str = ""
    probability: Mapping[str, float] = field(default_factory=dict)
    share: Mapping[str, float] = field(default_factory=dict)
    acts: frozenset[str] = frozenset()
    groups: tuple[frozenset[str], ...] = ()
    named: tuple[frozenset[str], ...] = ()
    intervals: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    seconds: float = 0.0
    error: str = ""

    @property
    def main(self) -> frozenset[str]:
        """The cause with the largest share, with its group; none where nothing is said to act."""
        if self.verdict in ("none", "unknown") or not self.probability:
            return frozenset()
        largest = max(self.probability, key=lambda c: (self.share.get(c, 0.0), self.probability[c]))
        return frozenset([largest]).union(*(group for group in self.groups if largest in group))


@dataclass(frozen=True)
class Outcome:
    """A set and what was found in it."""

    truth: Truth
    found: Found


def found_of(document: Mapping[str, Any]) -> Found:
    """A diagnosis as `hidden_effects.finder.diagnosed` returns it."""
    if "error" in document:
        return Found(seconds=float(document.get("busy", 0.0)), error=str(document["error"]))
    findings = document["findings"]
    probability: dict[str, float] = {}
    share: dict[str, float] = {}
    for row in findings["causes"]:
        cause = STANDS_FOR.get(row["cause"], row["cause"])
        probability[cause] = max(probability.get(cause, 0.0), row["probability"])
        if row["share"] is not None:
            share[cause] = share.get(cause, 0.0) + row["share"]
    parameters = document.get("parameters", {})
    changed = tuple(frozenset({row["kind"]}) for row in document.get("changes", []))
    return Found(
        verdict=document["verdict"],
        probability=probability,
        share=share,
        acts=frozenset(STANDS_FOR.get(r["cause"], r["cause"]) for r in findings["causes"] if r["word"] == "acts"),
        groups=tuple(frozenset(STANDS_FOR.get(c, c) for c in row["causes"]) for row in findings["groups"]),
        named=tuple(candidate_sets(dict(document))) or changed,
        intervals={
            key: (float(value["interval95"][0]), float(value["interval95"][1]))
            for key, value in parameters.items()
            if isinstance(value, dict)
        },
        seconds=float(document.get("busy", 0.0)),
    )


def of_own(truth: dict[str, Any]) -> Truth:
    """Of a set of this package's injector.

    A parameter that is a nuisance as well is left out: the diagnosis reports both together.
    """
    hidden = truth["hidden"]
    outside = truth["group"] == "outside"
    return Truth(
        generator="ramps",
        name=str(truth["set"]),
        group=truth["group"],
        causes=frozenset() if outside else frozenset(truth["causes"]),
        strength=min((float(one["strength"]) for one in hidden), default=None),
        alike=frozenset(admitted(truth)) if outside else frozenset(),
        parameters={
            # the size of a tilt, whichever way it goes
            one["parameter"]: abs(one["value"]) if one["parameter"].endswith("angle_rad") else float(one["value"])
            for one in hidden
            if one["parameter"]
            and one["value"] is not None
            and one["cause"]
            not in ("foot_compliance", "link_compliance", "link_length", "instrument_zero", "instrument_scale")
        },
    )


GROUPS = {"none": "quiet", "single": "single", "pair": "pair", "class": "inseparable", "unknown": "outside"}
"""Of sets by other authors."""


def of_given(generator: str, name: str, truth: Mapping[str, Any]) -> Truth:
    """Of a set by other authors: `docs/hidden-effects.md` has the format."""
    strengths = truth.get("d_members") or ([truth["d"]] if truth["effect"] else [])
    return Truth(
        generator=generator,
        name=name,
        group=GROUPS[truth["group"]],
        causes=frozenset(truth["causes"]),
        strength=min(strengths, default=None),
        parameters=_given_parameters(truth),
    )


def of_poses(number: int, group: str, causes: tuple[str, ...]) -> Truth:
    """Of a test of poses; its families' members are not single numbers, so that none has a true value here."""
    outside = group == "outside"
    kind = {"none": "quiet", "outside": "outside"}.get(group, "pair" if len(causes) > 1 else "single")
    # a belt that slips leaves another zero behind, and the series is cut there
    alike = frozenset({frozenset({"joint zero"})} if causes == ("slip",) else ())
    return Truth("poses", str(number), kind, frozenset() if outside else frozenset(causes), alike=alike)


def of_deflections(number: int, causes: frozenset[str]) -> Truth:
    """Of a test of deflections; none of its causes is weak."""
    return Truth("deflections", str(number), "pair" if len(causes) > 1 else "single", causes)


SPRINGS = frozenset({"actuator_compliance", "actuator_hardening", "actuator_three_slopes"})
"""Laws of one spring."""


def of_joint(
    seed: int, causes: Sequence[str], strengths: Mapping[str, float], parameters: Mapping[str, float]
) -> Truth:
    """Of a test of one joint. A spring whose bend hardly shows may be told as one of another law."""
    weak = {cause for cause in SPRINGS & set(causes) if strengths[cause] < STRONG}
    return Truth(
        generator="joints",
        name=str(seed),
        group=("quiet", "single", "pair")[len(causes)],
        causes=frozenset(causes),
        strength=min(strengths.values(), default=None),
        also=SPRINGS if weak else frozenset(),
        parameters=parameters,
    )


def _given_parameters(truth: Mapping[str, Any]) -> dict[str, float]:
    """True values, the nuisance's own draw included where the cause is a nuisance too."""
    drawn = truth["nuisances"]
    found: dict[str, float] = {}
    for effect in truth["effects"]:
        kind = effect["kind"]
        match kind:
            case "actuator_compliance":
                found[f"{kind}.compliance_mm_per_N"] = effect["c_mm_per_N"]
            case "actuator_backlash":
                found[f"{kind}.gap_mm"] = effect["gap_mm"]
            case "joint_friction":
                found[f"{kind}.torque_Nmm"] = sum(effect["torque_Nmm"]) / len(effect["torque_Nmm"])
            case "foot_compliance":
                found[f"{kind}.factor"] = effect["factor"] / drawn["mod_foot"]
            case "link_compliance":
                found[f"{kind}.factor"] = effect["factor"] / drawn["mod_bar"]
            case "link_length":
                found[f"{kind}.delta_mm"] = effect["dL_mm"] + drawn["dL"]
            case "plasticity":
                found[f"{kind}.yield_N"] = effect["yield_N"]
            case "instrument_zero" | "instrument_scale":
                channel = effect["channel"]
                found[f"{kind}.{channel}"] = effect["value"] + drawn[f"{channel}.{kind.partition('_')[2]}"]
            case _:
                # its law has other parameters than the principal one of the documentation
                pass
    return found


def covered(truth: Truth, found: Found) -> list[bool]:
    """Whether the intervals of a right cause's parameters hold the true values."""
    if truth.group not in ("single", "inseparable") or not any(truth.causes == one for one in found.named[:1]):
        return []
    return [
        low <= truth.parameters[key] <= high
        for key, (low, high) in found.intervals.items()
        if key in truth.parameters
    ]
