"""What is thought wrong of a robot, the fit of it, and its errors held out."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from vjm.rotations import Array
from vjm_updating.poses.fit import Blocks, PoseSolution
from vjm_updating.poses.forward import Frames, Linearised
from vjm_updating.poses.posture_noise import PostureNoise

COUPLING = "coupling"
AT_RANDOM, BY_LEVEL, BY_SERIES = "held out at random", "held out by level", "held out by series"


@dataclass(frozen=True)
class Hypothesis:
    """What is thought wrong.

    Attributes:
        families: names, in the order in which they were added.
        as_deflected: coupled joints thought to pass on deflections where the model says not, or the reverse.
        kept: members of these families that keep the model's value all the same.
    """

    families: tuple[str, ...] = ()
    as_deflected: tuple[str, ...] = ()
    kept: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Families, and the couplings among them."""
        return self.families + tuple(f"{COUPLING}.{joint}" for joint in self.as_deflected)

    def plus(self, name: str) -> Hypothesis:
        """With one more."""
        if name.startswith(f"{COUPLING}."):
            return replace(self, as_deflected=(*self.as_deflected, name.partition(".")[2]))
        return replace(self, families=(*self.families, name))

    def minus(self, name: str) -> Hypothesis:
        """Without one."""
        return Hypothesis(
            tuple(f for f in self.families if f != name),
            tuple(joint for joint in self.as_deflected if f"{COUPLING}.{joint}" != name),
            tuple(member for member in self.kept if not member.startswith(f"{name}.")),
        )


def mean_distance(distance: Array) -> float:
    """Mean of distances, nan where there is none."""
    known = distance[np.isfinite(distance)]
    return float(known.mean()) if len(known) else float("nan")


@dataclass(frozen=True)
class Errors:
    """Distances of markers from their predictions, mm; of tracked orientations the positions only.

    Of one posture alone nothing can be held out: there ``random`` and ``region`` are nan.

    Attributes:
        fitted: ``(g, k)`` of all readings fitted.
        random: ``(g, k)`` of postures held out at random.
        region: ``(g, k)`` of regions held out.
        levels: ``(g, k)`` of levels held out, the mean over the coordinates that have some; None: there are none.
        series: ``(g, k)`` of whole series held out, frames and zeros fitted there; None: there is one series.
    """

    fitted: Array
    random: Array
    region: Array
    levels: Array | None = None
    series: Array | None = None

    @property
    def between(self) -> Array:
        """Distances ``(g, k)`` within what was measured: of levels where there are some, else at random."""
        return self.random if self.levels is None else self.levels

    @property
    def way(self) -> str:
        """How the postures of `between` were held out, in words."""
        return AT_RANDOM if self.levels is None else BY_LEVEL

    @property
    def means(self) -> tuple[float, float, float]:
        """Mean distances fitted, between, and of regions; nan of what was not held out."""
        return mean_distance(self.fitted), mean_distance(self.between), mean_distance(self.region)

    @property
    def held_out(self) -> bool:
        """Whether anything was."""
        return bool(np.isfinite(self.random).any())

    @property
    def judged(self) -> tuple[float, ...]:
        """Mean distances by which fits are judged: of what was held out, else of the fit."""
        whole = () if self.series is None else (mean_distance(self.series),)
        return (*self.means[1:], *whole) if self.held_out else self.means[:1]


@dataclass(frozen=True)
class FittedState:
    """A hypothesis with its fit.

    Attributes:
        hypothesis: what is thought wrong.
        z: ``(P,)`` members, in units.
        frames: nuisances.
        at: the model there.
        blocks: normal equations of all members there.
        solution: the linear fit there.
        noise: how readings of like postures are correlated.
        whitened: normal equations of the readings made independent, by which hypotheses are compared.
        errors: of the readings.
        sigma: ``(g, k, 6)`` standard deviations with the robust weights.
        weight: ``(g, k)`` robust weights.
    """

    hypothesis: Hypothesis
    z: Array
    frames: Frames
    at: Linearised
    blocks: Blocks
    solution: PoseSolution
    noise: PostureNoise
    whitened: Blocks
    errors: Errors
    sigma: Array
    weight: Array


@dataclass(frozen=True)
class Candidates:
    """Readings that could be taken.

    Attributes:
        q: ``(c, n)`` coordinates of the joints, mm and rad.
        load: ``(c, l, 6)`` wrenches at the points of load, N and N mm; of tests without such points l is 0.
    """

    q: Array
    load: Array

    def __len__(self) -> int:
        return len(self.q)


@dataclass(frozen=True)
class Outlier:
    """A position that is not used: its row, marker, and how far it is off, mm."""

    row: int
    marker: str
    distance: float
