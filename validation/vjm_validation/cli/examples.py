"""What stands behind the help of each command: an example, what comes next, and the page of the docs."""

from __future__ import annotations

EXAMPLES = {
    "all": (
        "validate all --quick --out run",
        "open run/index.html; validate compare run OTHER",
        "README.md, docs/verification.md",
    ),
    "compare": (
        "validate compare before after --tolerance 1e-4 --report moved.html",
        "Exit status: 0 where no figure moved or was lost, 1 where one did, 2 for what is no run",
        "README.md",
    ),
    "curve": (
        "validate curve orthoglide-chain --posture A --to -4 --report path.html",
        "validate buckling orthoglide-chain",
        "docs/load-cases.md",
    ),
    "buckling": (
        "validate buckling orthoglide-chain --posture A --engine vjm exudyn --plot paths.png",
        "validate curve",
        "docs/load-cases.md",
    ),
    "stiffness": (
        "validate stiffness orthoglide-chain --posture A --displacement=-1,0,0,0,0,0",
        "validate curve",
        "docs/load-cases.md, docs/design.md",
    ),
    "modes": (
        "validate modes ur10 --gravity 0,0,-9.81 --plot modes.png",
        "validate stiffness ur10 --wrench 0,0,-100,0,0,0 --shares",
        "docs/design.md",
    ),
    "section": (
        "validate section rectangular_tube width_mm=100 thickness_mm=60 wall_mm=4 --plot tube.png",
        "write the same keys into a part's section: docs/model-file.md",
        "docs/model-file.md",
    ),
    "explore": (
        "validate explore ur10 --posture 0.3,-1.2,1.4,-0.5,1.5,0 --wrench 0,0,-100,0,0,0",
        "validate stiffness ur10 --wrench 0,0,-100,0,0,0 --shares",
        "docs/explore.md",
    ),
    "sensitivity": (
        "validate sensitivity planar-2r --posture bent --wrench 0,-50,0,0,0,0 --plot tornado.png",
        "validate stiffness planar-2r --wrench 0,-50,0,0,0,0 --shares",
        "docs/design.md",
    ),
    "sweep": (
        "validate sweep planar-2r --vary upper.section.width_mm=40:80:5 --wrench 0,-50,0,0,0,0 --plot sweep.png",
        "validate optimise",
        "docs/design.md",
    ),
    "optimise": (
        "validate optimise planar-2r --minimise deflection --vary upper.length_mm=400:600 --wrench 0,-50,0,0,0,0",
        "validate check BEST.toml",
        "docs/design.md",
    ),
    "calibrate": (
        "validate calibrate DATA.csv --sheet SHEET.toml --out DIR",
        "validate diagnose",
        "docs/calibration.md",
    ),
    "diagnose": (
        "validate diagnose DATA.csv --sheet SHEET.toml --out DIR",
        "validate curve DIR/extended-model.toml --to -1",
        "docs/diagnosis.md",
    ),
    "simulate": (
        "validate simulate orthoglide-chain --test SHEET.toml --hide link_bow=1.0 --engine exudyn",
        "validate diagnose",
        "docs/diagnosis.md, docs/effects.md",
    ),
    "identify": ("validate identify orthoglide-chain --part link", "", "docs/identification.md"),
    "import": ("validate import robot.urdf --tip tool0", "validate check robot.toml", "docs/model-file.md"),
    "export": ("validate export ur10 --urdf ur10.urdf --mjcf ur10.xml", "", "docs/model-file.md"),
    "example": ("validate example ur10-poses", "the command that it prints", "docs/examples.md"),
    "check": ("validate check MODEL.toml", "", "docs/model-file.md"),
    "map": ("validate map orthoglide --grid 11 --report map.html", "", "docs/manipulators.md"),
}
"""By command: a call, what to do next, and where to read on."""


def epilogue(command: str) -> str:
    """The text behind a command's help; empty for one that needs none."""
    if command not in EXAMPLES:
        return ""
    example, following, page = EXAMPLES[command]
    then = f" Next: {following}." if following else ""
    return f"Example: {example}.{then} Docs: {page}."
