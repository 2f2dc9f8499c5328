"""What holds the joints of an MJCF model elastically: springs of joints and of fixed tendons, servos' gains."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from vjm.io.errors import printed
from vjm.io.mjcf_constraints import METRE, ConstrainedModel

LEAST_STIFFNESS = 1e-3
"""N mm/rad or N/mm: the inverse of the largest compliance of a model file. What is softer holds nothing."""


@dataclass(frozen=True)
class JointSpring:
    """What holds one coordinate.

    Attributes:
        spring: stiffness of all springs, N mm/rad or N/mm.
        servo: stiffness that position gains of actuators add, in the same unit.
        rest: coordinate at which the springs together are free of stress, rad or mm.
    """

    spring: float = 0.0
    servo: float = 0.0
    rest: float = 0.0

    def with_spring(self, stiffness: float, rest: float) -> JointSpring:
        """Beside one more spring."""
        total = self.spring + stiffness
        # a spring alone keeps its rest to the last digit
        middle = rest if not self.spring else (self.spring * self.rest + stiffness * rest) / total
        return JointSpring(total, self.servo, middle)


@dataclass(frozen=True)
class _Elastic:
    """A spring or a gain on a sum of joints: ``stiffness`` times ``Σ weight · coordinate − rest``, SI units."""

    name: str
    weights: dict[int, float]
    stiffness: float
    rest: float = 0.0
    servo: str = ""
    tendon: bool = False


class SprungModel(ConstrainedModel):
    """A compiled model, with what holds its joints elastically."""

    _gains_read = _tendons_read = 0

    def _joint_springs(self, taken: list[int]) -> dict[int, JointSpring]:
        """By joint that follows none, all that holds it; what holds its followers is reflected to it.

        Of what moves no body that is taken nothing is said.
        """
        leads, found, gains = self._leads(), dict[int, JointSpring](), list[str]()
        matter = {
            leads.get(joint, joint) for joint in self._single() if int(self._model.jnt_bodyid[joint]) in taken
        }
        for one in (*self._springs_of_joints(), *self._springs_of_tendons(), *self._gains()):
            weights, shift = self._on_leads(one.weights)
            if not matter.intersection(weights):
                continue
            if len(weights) > 1:
                self._notes.left_out.append(f"{one.name}, which holds a sum of joints that move independently")
                continue
            ((joint, weight),) = weights.items()
            # ½ k L² is in J, 1e3 N mm
            stiffness = 1e3 * one.stiffness * weight**2
            if stiffness < LEAST_STIFFNESS:
                self._notes.left_out.append(f"{one.name}, which is softer than any spring of a model file")
                continue
            before = found.get(joint, JointSpring())
            if one.servo:
                found[joint] = JointSpring(before.spring, before.servo + stiffness, before.rest)
                gains.append(f"{self._joint_name(joint)} ({one.servo})")
                self._gains_read += 1
            else:
                self._tendons_read += one.tendon
                found[joint] = before.with_spring(stiffness, (one.rest - shift) / weight)
        if gains:
            self._notes.changed.append(
                f"the compliance of drives is that of their servos' position gains: {', '.join(gains)}. It is the "
                "controller's, and has nothing of gears"
            )
        return found

    def _on_leads(self, weights: dict[int, float]) -> tuple[dict[int, float], float]:
        """Weights of the coordinates, mm or rad, of joints that follow none, and what is added to their sum."""
        leads, total, shift = self._leads(), dict[int, float](), 0.0
        for joint, weight in weights.items():
            own = weight / METRE if self._slides(joint) else weight
            if (mimic := self._mimics.get(joint)) is not None:
                shift += own * mimic.offset
                own *= mimic.ratio
            lead = leads.get(joint, joint)
            total[lead] = total.get(lead, 0.0) + own
        return {joint: weight for joint, weight in total.items() if weight}, shift

    def _single(self) -> list[int]:
        """Joints of one freedom."""
        types = self._mujoco.mjtJoint
        kinds = int(types.mjJNT_HINGE), int(types.mjJNT_SLIDE)
        return [joint for joint in range(self._model.njnt) if int(self._model.jnt_type[joint]) in kinds]

    def _springs_of_joints(self) -> Iterator[_Elastic]:
        model = self._model
        for joint in self._single():
            stiffness, name = float(model.jnt_stiffness[joint]), f"the spring of joint '{self._joint_name(joint)}'"
            if self._is_linear("jnt", joint, name) and stiffness > 0.0:
                rest = float(model.qpos_spring[int(model.jnt_qposadr[joint])])
                yield _Elastic(name, {joint: 1.0}, stiffness, rest)

    def _is_linear(self, kind: str, index: int, name: str) -> bool:
        """Whether a spring has a constant stiffness; else it is left out."""
        poly = getattr(self._model, f"{kind}_stiffnesspoly", None)
        if poly is None or not poly[index].any():
            return True
        self._notes.left_out.append(f"{name}, which is not linear")
        return False

    def _springs_of_tendons(self) -> Iterator[_Elastic]:
        model = self._model
        for tendon in range(model.ntendon):
            stiffness, name = float(model.tendon_stiffness[tendon]), f"the spring of {self._tendon_name(tendon)}"
            if not self._is_linear("tendon", tendon, name) or not stiffness > 0.0:
                continue
            low, high = (float(v) for v in model.tendon_lengthspring[tendon])
            weights = self._tendon_weights(tendon)
            if not weights:
                self._notes.left_out.append(f"{name}, which is no sum of joints")
            elif low < high:
                self._notes.left_out.append(f"{name}, which is slack from {printed(low)} to {printed(high)}")
            else:
                yield _Elastic(name, weights, stiffness, low, tendon=True)

    def _tendon_name(self, tendon: int) -> str:
        return f"tendon '{self._name('TENDON', tendon) or f'number {tendon + 1}'}'"

    def _tendon_weights(self, tendon: int) -> dict[int, float]:
        """Of joints of one freedom whose sum is the length of a fixed tendon; none of another tendon."""
        model, found = self._model, dict[int, float]()
        single = self._single()
        for k, joint in self._wrapped(tendon):
            if joint not in single:
                return {}
            found[joint] = found.get(joint, 0.0) + float(model.wrap_prm[k])
        return found

    def _gains(self) -> Iterator[_Elastic]:
        """Position gains of actuators: their force falls with the length that they drive."""
        model, kinds = self._model, self._mujoco.mjtTrn
        affine = int(self._mujoco.mjtBias.mjBIAS_AFFINE)
        single = self._single()
        for k in range(model.nu):
            per_length, per_speed = (float(-v) for v in model.actuator_biasprm[k][1:3])
            if int(model.actuator_biastype[k]) != affine or not per_length:
                continue
            name = f"the position gain of actuator '{self._name('ACTUATOR', k) or f'number {k + 1}'}'"
            driven, weights = int(model.actuator_trnid[k][0]), dict[int, float]()
            if int(model.actuator_trntype[k]) in (int(kinds.mjTRN_JOINT), int(kinds.mjTRN_JOINTINPARENT)):
                weights = {driven: 1.0} if driven in single else {}
            elif int(model.actuator_trntype[k]) == int(kinds.mjTRN_TENDON):
                weights = self._tendon_weights(driven)
            if not weights:
                continue
            if per_length < 0.0:
                self._notes.left_out.append(f"{name}, which pushes away from where it is sent")
                continue
            gear = float(model.actuator_gear[k][0])
            said = f"kp {printed(per_length)}" + (f", kv {printed(per_speed)}" if per_speed else "")
            said += f", gear {printed(gear)}" if gear != 1.0 else ""
            yield _Elastic(name, {j: gear * w for j, w in weights.items()}, per_length, servo=said)
