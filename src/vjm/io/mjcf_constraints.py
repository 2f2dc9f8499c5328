"""What holds the joints of an MJCF model: closures, followers, actuators, and which of it moves a tip."""

from __future__ import annotations

from typing import Any

from vjm.io.errors import ModelFileError, did_you_mean
from vjm.io.robot import ON_ITS_BASE, Mimic, Notes

METRE = 1000.0
Library = Any
"""MuJoCo, or a model of its; neither has types where it is not installed."""
WORLD = "world"


class ConstrainedModel:
    """A compiled model, with what its equalities and actuators say of its joints."""

    def __init__(self, mujoco: Library, model: Library, file: str) -> None:
        self._mujoco, self._model, self._file = mujoco, model, file
        self._notes = Notes()
        self._bodies = [self._name("BODY", i) or f"body-{i}" for i in range(model.nbody)]
        self._bodies[0] = WORLD
        kinds = mujoco.mjtEq
        self._closing = {int(kinds.mjEQ_CONNECT): True, int(kinds.mjEQ_WELD): False}
        self._standing: dict[int, float] = {}
        self._mimics = self._followers()
        self._closures_kept: list[int] = []

    def _name(self, kind: str, index: int) -> str:
        name = self._mujoco.mj_id2name(self._model, getattr(self._mujoco.mjtObj, f"mjOBJ_{kind}"), index)
        return str(name or "")

    def _joint_name(self, joint: int) -> str:
        return self._name("JOINT", joint) or f"{self._bodies[int(self._model.jnt_bodyid[joint])]}-joint-{joint}"

    def _slides(self, joint: int) -> bool:
        """Whether a joint slides.

        Raises:
            ModelFileError: it neither slides nor turns about one axis.
        """
        kind = int(self._model.jnt_type[joint])
        types = self._mujoco.mjtJoint
        if kind in (int(types.mjJNT_FREE), int(types.mjJNT_BALL)):
            free = kind == int(types.mjJNT_FREE)
            what = f"free, {ON_ITS_BASE}" if free else "a ball: write three hinges"
            raise ModelFileError(f"{self._file}: joint '{self._joint_name(joint)}' is {what}")
        return kind == int(types.mjJNT_SLIDE)

    @property
    def _closes(self) -> bool:
        return bool(self._closures_kept)

    def _way(self, body: int) -> list[int]:
        """The bodies from the world, without it, to one of them."""
        way = list[int]()
        while body:
            way.insert(0, body)
            body = int(self._model.body_parentid[body])
        return way

    def _taken(self, tip: str | None) -> list[int]:
        """Bodies in their order, parents first: all, or those that move the tip; which loops are kept is noted.

        Without loops that move it they are the way to it. With some they are all but what has joints of its own
        that do not move it.
        """
        model = self._model
        loops = {k: self._loop(k) for k in range(model.neq) if self._is_closure(k)}
        if tip is None:
            self._closures_kept = list(loops)
            return list(range(1, model.nbody))
        if tip not in self._bodies:
            hint = did_you_mean(tip, self._bodies) or f" (there are {', '.join(self._bodies)})"
            raise ModelFileError(f"{self._file}: no body '{tip}'{hint}")
        way = self._way(self._bodies.index(tip))
        moving, kept = set(way), set[int]()
        while found := {k for k, loop in loops.items() if k not in kept and self._jointed(loop & moving)}:
            kept |= found
            for body in set().union(*(loops[k] for k in found)):
                moving.update(self._way(body))
            # what a joint follows moves the tip by its own loops
            masters = {m for j, m in self._leads().items() if int(model.jnt_bodyid[j]) in moving}
            looped = set().union(*loops.values())
            for body in {int(model.jnt_bodyid[m]) for m in masters} & looped:
                moving.update(self._way(body))
        self._closures_kept = sorted(kept)
        dropped = set(loops) - kept
        if dropped:
            named = ", ".join(self._closure_name(k) for k in sorted(dropped))
            self._notes.left_out.append(f"closed loops that do not move '{tip}': {named}")
        if not kept:
            return way
        idle = {body for body in range(1, model.nbody) if model.body_jntnum[body]} - moving
        return [body for body in range(1, model.nbody) if not idle.intersection(self._way(body))]

    def _is_closure(self, k: int) -> bool:
        if int(self._model.eq_type[k]) not in self._closing or not self._model.eq_active0[k]:
            return False
        # what a simulation moves by hand holds nothing
        return all(self._model.body_mocapid[body] < 0 for body in self._closed_bodies(k))

    def _closed_bodies(self, k: int) -> tuple[int, int]:
        ids = int(self._model.eq_obj1id[k]), max(0, int(self._model.eq_obj2id[k]))
        if int(self._model.eq_objtype[k]) == int(self._mujoco.mjtObj.mjOBJ_SITE):
            return int(self._model.site_bodyid[ids[0]]), int(self._model.site_bodyid[ids[1]])
        return ids

    def _closure_name(self, k: int) -> str:
        first, second = (self._bodies[i] for i in self._closed_bodies(k))
        return self._name("EQUALITY", k) or f"{first}-to-{second}"

    def _loop(self, k: int) -> set[int]:
        """The bodies whose joints move the two bodies of a closure against one another."""
        first, second = (set(self._way(i)) for i in self._closed_bodies(k))
        return first ^ second

    def _jointed(self, bodies: set[int]) -> bool:
        return any(self._model.body_jntnum[body] for body in bodies)

    def _leads(self) -> dict[int, int]:
        """By follower, the joint that it follows in the end."""
        numbers = {self._joint_name(joint): joint for joint in range(self._model.njnt)}
        return {joint: numbers[mimic.joint] for joint, mimic in self._mimics.items()}

    def _driven_joints(self, taken: list[int]) -> set[int]:
        """Joints that an actuator holds: its own, those that follow or lead it, and what its tendon moves.

        Raises:
            ModelFileError: of a machine with loops, one drive holds a sum of joints that move independently.
        """
        model, kinds, leads = self._model, self._mujoco.mjtTrn, self._leads()
        by_joint = (int(kinds.mjTRN_JOINT), int(kinds.mjTRN_JOINTINPARENT))
        held, others = set[int](), list[int]()
        for k in range(model.nu):
            if int(model.actuator_trntype[k]) in by_joint:
                joint = int(model.actuator_trnid[k][0])
                held.add(leads.get(joint, joint))
            else:
                others.append(k)
        for k in others:
            moved = {leads.get(joint, joint) for joint in self._pulled(k)} - held
            moved = {joint for joint in moved if int(model.jnt_bodyid[joint]) in taken}
            if len(moved) > 1 and self._closes:
                named = ", ".join(self._joint_name(joint) for joint in sorted(moved))
                raise ModelFileError(
                    f"{self._file}: one tendon drives the joints {named}, which move independently of one another: "
                    "no model has that. Couple them by an equality, or give each an actuator"
                )
            held |= moved
            if self._closes and not self._pulled(k):
                what = self._name("ACTUATOR", k) or f"number {k + 1}"
                self._notes.doubtful.append(f"the actuator '{what}' drives no joint: what it holds is not read")
        return {joint for joint in range(model.njnt) if leads.get(joint, joint) in held}

    def _pulled(self, actuator: int) -> list[int]:
        """Joints of the fixed tendon that an actuator drives; none where it drives something else."""
        model = self._model
        if int(model.actuator_trntype[actuator]) != int(self._mujoco.mjtTrn.mjTRN_TENDON):
            return []
        return [joint for _, joint in self._wrapped(int(model.actuator_trnid[actuator][0]))]

    def _wrapped(self, tendon: int) -> list[tuple[int, int]]:
        """Places in MuJoCo's list and joints of a fixed tendon; none of a tendon in space."""
        model = self._model
        first = int(model.tendon_adr[tendon])
        wraps = range(first, first + int(model.tendon_num[tendon]))
        kind = int(self._mujoco.mjtWrap.mjWRAP_JOINT)
        return [(k, int(model.wrap_objid[k])) for k in wraps if int(model.wrap_type[k]) == kind]

    def _followers(self) -> dict[int, Mimic]:
        """What joints follow others in the end, by equalities that are straight lines; which stand is noted."""
        model, steps = self._model, dict[int, tuple[int, float, float]]()
        for k in range(model.neq):
            if self._is_closure(k):
                continue
            found = self._relation(k) if model.eq_active0[k] else None
            if found is None or len(found[0]) not in (1, 2):
                kind = str(self._mujoco.mjtEq(int(model.eq_type[k])).name).removeprefix("mjEQ_").lower()
                self._notes.left_out.append(f"the equality '{self._name('EQUALITY', k) or kind}' ({kind})")
                continue
            weights, offset = found
            # the last joint of a tendon follows the first one, but for one that follows already
            a = next((joint for joint in reversed(weights) if joint not in steps), next(iter(weights)))
            unit = {joint: METRE if self._slides(joint) else 1.0 for joint in weights}
            at = {joint: float(model.qpos0[int(model.jnt_qposadr[joint])]) for joint in weights}
            shift = at[a] + offset / weights[a]
            if len(weights) == 1:
                self._standing[a] = unit[a] * shift
                continue
            (b,) = (joint for joint in weights if joint != a)
            ratio = -weights[b] / weights[a]
            steps[a] = b, ratio * unit[a] / unit[b], unit[a] * (shift - ratio * at[b])
        followers = {}
        for joint in steps:
            ratio, offset, at_joint, seen = 1.0, 0.0, joint, {joint}
            while at_joint in steps:
                other, step, shift = steps[at_joint]
                ratio, offset, at_joint = ratio * step, offset + ratio * shift, other
                if at_joint in seen:
                    raise ModelFileError(f"{self._file}: joint '{self._joint_name(joint)}' follows itself")
                seen.add(at_joint)
            if at_joint in self._standing:
                self._standing[joint] = ratio * self._standing[at_joint] + offset
            else:
                followers[joint] = Mimic(self._joint_name(at_joint), ratio, offset)
        return followers

    def _relation(self, k: int) -> tuple[dict[int, float], float] | None:
        """Weights of joints and a constant: the weighted sum of what they moved from where the file has them.

        None where an equality is no straight line, or holds something else than joints and fixed tendons. The
        joint that follows is the last one.
        """
        model, kinds = self._model, self._mujoco.mjtEq
        kind, first, second = int(model.eq_type[k]), int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
        offset, ratio, *higher = (float(v) for v in model.eq_data[k][:5])
        if second >= 0 and any(higher):
            return None
        weights: dict[int, float] = {}
        for held, factor in ((second, -ratio), (first, 1.0)):
            if held < 0:
                continue
            if kind == int(kinds.mjEQ_JOINT):
                weights[held] = weights.get(held, 0.0) + factor
            elif kind == int(kinds.mjEQ_TENDON) and len(self._wrapped(held)) == int(model.tendon_num[held]):
                for place, joint in self._wrapped(held):
                    weights[joint] = weights.get(joint, 0.0) + factor * float(model.wrap_prm[place])
            else:
                return None
        return {joint: weight for joint, weight in weights.items() if weight}, offset
