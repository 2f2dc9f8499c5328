"""What of an SDF file is read and what is omitted, element by element."""

from __future__ import annotations

from vjm.io.urdf_content import CONTROL, DRIVES, SHAPES, FormatKeys

INCLUDED = "other files, which are not read: import them by themselves"
WORLDS = "what a simulator's world has"
_POSE = {"relative_to": "", "frame": "", "degrees": "", "rotation_format": ""}
_DENSE = "moments of inertia by density"
_SOLVED = "what a simulator's solver takes"
_AXIS = {
    "xyz": "",
    "limit": "",
    "dynamics": "",
    "mimic": "",
    "use_parent_model_frame": "",
    "initial_position": CONTROL,
}

SDF = FormatKeys(
    root=("sdf", "world", "model"),
    children={
        "sdf": {"world": "", "model": "", "light": WORLDS, "actor": WORLDS, "include": INCLUDED},
        "world": {
            "model": "", "include": INCLUDED, "plugin": CONTROL, "physics": WORLDS, "scene": WORLDS,
            "light": WORLDS, "gravity": WORLDS, "magnetic_field": WORLDS, "atmosphere": WORLDS, "wind": WORLDS,
            "audio": WORLDS, "gui": WORLDS, "road": WORLDS, "spherical_coordinates": WORLDS, "state": WORLDS,
            "population": WORLDS, "actor": WORLDS, "frame": WORLDS, "joint": WORLDS,
        },
        "model": {
            "model": "", "link": "", "joint": "", "frame": "", "pose": "", "static": "", "include": INCLUDED,
            "plugin": CONTROL, "gripper": CONTROL, "self_collide": SHAPES, "allow_auto_disable": _SOLVED,
            "enable_wind": WORLDS, "material": SHAPES,
        },
        "link": {
            "inertial": "", "pose": "", "visual": SHAPES, "collision": SHAPES, "sensor": CONTROL,
            "projector": CONTROL, "light": WORLDS, "particle_emitter": WORLDS, "audio_source": WORLDS,
            "audio_sink": WORLDS, "battery": CONTROL, "velocity_decay": DRIVES, "must_be_base_link": _SOLVED,
            "self_collide": SHAPES, "enable_wind": WORLDS, "gravity": WORLDS, "kinematic": _SOLVED,
            "plugin": CONTROL,
        },
        "frame": {"pose": ""},
        "inertial": {
            "mass": "", "pose": "", "inertia": "", "density": _DENSE, "fluid_added_mass": WORLDS,
            "auto_inertia_params": _DENSE, "frame": _SOLVED,
        },
        "inertia": dict.fromkeys(("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), ""),
        "joint": {
            "parent": "", "child": "", "pose": "", "axis": "", "axis2": "", "physics": _SOLVED, "sensor": CONTROL,
            "plugin": CONTROL, "gearbox_ratio": DRIVES, "gearbox_reference_body": DRIVES, "thread_pitch": DRIVES,
            "screw_thread_pitch": DRIVES,
            "drake:rotor_inertia": "", "drake:gear_ratio": "",
        },
        "axis": _AXIS, "axis2": _AXIS,
        "limit": {
            "lower": "", "upper": "", "effort": DRIVES, "velocity": DRIVES, "stiffness": _SOLVED,
            "dissipation": _SOLVED,
        },
        "dynamics": {"spring_stiffness": "", "spring_reference": "", "damping": DRIVES, "friction": DRIVES},
        "mimic": {"multiplier": "", "offset": "", "reference": ""},
    },
    attributes={
        "sdf": {"version": ""},
        "world": {"name": ""},
        "model": {"name": "", "canonical_link": "", "placement_frame": ""},
        "link": {"name": ""},
        "frame": {"name": "", "attached_to": ""},
        "joint": {"name": "", "type": ""},
        "inertial": {"auto": _DENSE},
        "pose": _POSE,
        "xyz": {"expressed_in": ""},
        "mimic": {"joint": "", "axis": ""},
    },
    once={
        "inertial", "pose", "mass", "inertia", "parent", "child", "axis", "axis2", "limit", "dynamics", "mimic",
        "xyz",
    },
)  # fmt: skip
