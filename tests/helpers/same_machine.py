"""Whether two chains are one machine, as far as descriptions of rigid bodies hold one."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from vjm.machine.equilibria import unloaded_frames
from vjm.model.machine import Machine
from vjm.model.mechanism import Mechanism
from vjm.model.parts import Joint, JointKind

# Numbers are written exactly; rotations pass through three angles, at 1e-16 each, in up to a hundred parts. The
# worst of all public robots are 4e-14 in a rotation's entries, and 1e-15 of the machine's reach in a position.
ROTATIONS, POSITIONS = 1e-12, 1e-13


@dataclass
class RigidBodies:
    """What a description of rigid bodies holds of a chain, by the joints' names."""

    chain: Machine

    def joints(self) -> dict[str, Joint]:
        pushing = self.chain.pushing
        return {joint.name: joint for joint in self.chain.moving if joint.name not in pushing}

    def ends(self) -> dict[str, str]:
        """End frames by name: the part behind which each lies."""
        return dict(self.chain.ends) or {"tool": self.chain.parts[-1].name}

    def frames(self, q: dict[str, float], names: set[str]) -> tuple[np.ndarray, np.ndarray, float]:
        """Where some ends and all joints stand, (n, 3, 3) and (n, 3), and the reach, mm."""
        ends = {name: part for name, part in self.ends().items() if name in names}
        held = {f"joint-{name}": name for name in self.joints()}
        chain = self.with_ends({**ends, **held})
        model = Mechanism(chain.split())
        R, p = unloaded_frames(model, model.command_rows(q)[0])
        order = np.argsort(list(model.ends))
        return R[0, order], p[0, order], model.reach

    def with_ends(self, ends: dict[str, str]) -> Machine:
        # what is rigid deflects nowhere, and a machine that does not is none
        parts = [
            replace(part, compliance=part.compliance or 1e-8, law=None)
            if isinstance(part, Joint) and part.kind is JointKind.ACTUATED and part.matrix is None
            else part
            for part in self.chain.parts
        ]
        return replace(self.chain, parts=tuple(parts), ends=ends)


def masses(chain: Machine) -> list[tuple[float, tuple[float, ...]]]:
    """Of the bodies, kg, with their centres in the frames where their parts begin, mm."""
    found = [(part.mass, tuple(part.centre_of_mass)) for part in chain.parts if getattr(part, "mass", 0.0) > 0.0]
    return sorted(found)


def same(first: Machine, second: Machine, digits: float = 0.0, *, ordered: bool = True) -> None:
    """Two chains are one machine: joints, limits, couplings, and frames of all joints and ends in 20 postures.

    Limits and couplings differ by ``digits`` of themselves at most. Joints have the same order where that is asked:
    import reads a tree branch by branch.
    """
    one, other = RigidBodies(first), RigidBodies(second)
    mine, theirs = one.joints(), other.joints()
    assert (list(mine) if ordered else sorted(mine)) == (list(theirs) if ordered else sorted(theirs))
    for name, a in mine.items():
        b = theirs[name]
        assert a.slides == b.slides
        assert a.axis == pytest.approx(b.axis, abs=1e-15)
        limits = getattr(a, "limits", None)
        assert getattr(b, "limits", None) == (limits and pytest.approx(limits, rel=digits, abs=0.0))
        assert (a.coupling is None) == (b.coupling is None)
        if a.coupling is not None and b.coupling is not None:
            assert dict(b.coupling.ratios) == pytest.approx(dict(a.coupling.ratios), rel=digits, abs=0.0)
            assert b.coupling.offset == pytest.approx(a.coupling.offset, rel=digits, abs=0.0)
    # the joint that stands at the base for its followers is an end of the file
    ends = set(one.ends())
    assert ends <= set(other.ends())
    rng = np.random.default_rng(0)
    for _ in range(20):
        q = {
            name: rng.uniform(-1.0, 1.0) * (100.0 if part.slides else 1.0)
            for name, part in mine.items()
            if part.coupling is None
        }
        (R, p, reach), (R2, p2, _) = (machine.frames(q, ends) for machine in (one, other))
        assert R2 == pytest.approx(R, abs=ROTATIONS)
        assert p2 == pytest.approx(p, abs=POSITIONS * reach)
