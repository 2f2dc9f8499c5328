"""Where elements sit in a machine: by the kinds of its parts, whatever these are called."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from vjm.model.joints import Joint
from vjm.model.machine import FOOT, Machine
from vjm.model.parts import Beam
from vjm.rotations import rotate_matrix6
from vjm_updating.constants import numerical
from vjm_updating.mechanisms.joint_motions import braced, joint_motions
from vjm_updating.mechanisms.modified_chain import ModifiedChain, beam_of, link_of, links_of, place_of
from vjm_updating.mechanisms.series_elements import AlongAxis, AlongLine, AtJoint, Behind, ElementSite

SAME = numerical(1e-9)
"""Difference of unit vectors that is rounding."""


def drive(machine: ModifiedChain) -> AlongAxis:
    """The drive.

    Raises:
        ValueError: there is none.
    """
    axis = machine.drive_axis
    if axis is None:
        raise ValueError(f"{machine.nominal.name}: there is no actuator")
    return AlongAxis((float(axis[0]), float(axis[1]), float(axis[2])))


def foot(machine: ModifiedChain) -> Behind:
    """The foot's tip, which deflects by the foot's own compliance under the force along the link on it."""
    chain = machine.chain()
    beam = beam_of(chain, FOOT)
    C = rotate_matrix6(beam.tip_compliance(), chain.base[:3, :3] @ beam.own_frame)[:3, :3]
    return Behind(
        tuple(tuple(float(v) for v in row) for row in C), place_of(machine.nominal, links_of(machine.nominal)[0])
    )


def along_link(machine: ModifiedChain, link: str) -> ElementSite:
    """A link, or its joints, along the line from its root to its tip; the only one where there is no name."""
    return AtJoint(link or link_of(machine.nominal)) if machine.nominal.closes else AlongLine(link)


def along_links(machine: ModifiedChain, postures: Iterable[str], jointed: bool) -> list[tuple[str, str]]:
    """Places along links where something may slip or deflect, from base to tool.

    What slips shifts all that is behind it along the link's line, so that it makes no difference where along the
    link it sits, at its root, in it or at its tip. Nor does it with links whose lines are one direction in every
    posture of a test: no reading distinguishes them, and they are one place.

    Args:
        machine: the nominal one.
        postures: of the test.
        jointed: only links with a joint between them and the beam, or the end of the chain, before or behind:
            joints have backlash and contacts along the links that they join.

    Returns:
        Of each place what a verdict calls it, and the link whose line it is; both empty for the only link.
    """
    chain, labels = machine.nominal, sorted(postures)
    names = [name for name in links_of(chain) if not jointed or has_joint(chain, name)]
    if chain.closes:
        away = braced(machine, labels)
        names = [name for name in names if name not in away]
    if len(links_of(chain)) == 1:
        return [("", "")] if names else []
    places: list[tuple[list[str], np.ndarray]] = []
    moved = [(label, joint_motions(machine, label)) for label in labels] if chain.closes else []
    unit = np.repeat([1.0, chain.characteristic_length], 3)
    for name in names:
        if chain.closes:
            # what differs by a factor alone is no other place
            lines = np.array([at[name] * unit for _, at in moved])
            lines /= np.linalg.norm(lines) or 1.0
        else:
            lines = np.array([machine.line(label, name) for label in labels])
        same = next((own for own, other in places if len(labels) and np.abs(other - lines).max() < SAME), None)
        if same is None:
            places.append(([name], lines))
        else:
            same.append(name)
    return [(" or ".join(own), own[0]) for own, _ in places]


def has_joint(chain: Machine, link: str) -> bool:
    """Whether a joint stands next to a link, other beams aside."""
    at = next(i for i, part in enumerate(chain.parts) if part.name == link)
    for side in (reversed(chain.parts[:at]), chain.parts[at + 1 :]):
        for part in side:
            if isinstance(part, Beam):
                break
            if isinstance(part, Joint) and not part.fixed:
                return True
    return False
