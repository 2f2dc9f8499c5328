"""Which numbers of calibration and diagnosis somebody has chosen, and why: a new one has to be put into a list."""

from __future__ import annotations

import ast
from itertools import chain
from pathlib import Path

SOURCES = Path(__file__).parents[2] / "src/vjm_updating"
MOST_TUNED = 4
"""What was reached; ten was the aim."""

TUNED = {
    "observation/significance": "FALSE_ALARMS",
    "diagnosis/screening": "FAR_OFF",
    "inference/outliers": "LONELY APART",
}
"""They decide what a verdict says, and were set by development sets or by judgement."""

PRIORS = {
    "observation/significance": "OUTLIERS NOISE_KNOWN",
    "diagnosis/evidence": "RARER RAREST LAW_ERROR",
    "observation/ramp_regression": "ASSUMED_AUTOCORRELATION",
    "inference/instrument": "MOST_DRIFT LEVER USUAL_LAG",
    "observation/autocorrelation": "ALIKE USUAL WIDE",
    "inference/parameters": "FARTHEST PARTS SHARE LOST USUAL",
    "diagnosis/ramp_kind": "LONG_BEFORE",
    "diagnosis/column": "SET BEFORE",
    "diagnosis/run": "NOISE_ALONE",
    "calibration/parameters": "WEAK SOFT_DRIVE RIGID",
}
"""Physical bounds and priors, each with a unit: of a size, a share, or odds."""

NUMERICS = {
    "observation/significance": "NORMAL_95 CUT",
    "diagnosis/chi_bar_squared": "DRAWS SEED STEEP",
    "diagnosis/column": "LEAST",
    "diagnosis/run": "AGAIN",
    "diagnosis/critical": "LEAST",
    "diagnosis/discrepancy": "NODES WEIGHTS",
    "diagnosis/estimates": "PARTS DRAWS THINNED",
    "inference/fitting": "FARTHER ROUNDING",
    "inference/forward": "MARGIN KEPT ROUNDS",
    "inference/load_forward": "KEPT",
    "diagnosis/holdout": "BLOCK DRAWS SEED",
    "diagnosis/mark_selection": "THIRD DRAWS SEED",
    "diagnosis/model_adequacy": "DRAWS SEED TAIL",
    "observation/autocorrelation": "GRID SIZES FEWEST RANK STATIONARY",
    "inference/normal_equations": "SWEEPS LONGEST",
    "inference/parameters": "ALTERNATIVE_FACTOR",
    "diagnosis/preprocess": "SAME_AUTOCORRELATION SAME_NOISE",
    "observation/idle_axes": "LEAST",
    "observation/ramp_regression": "MOST POLYNOMIAL_ORDER LEAST",
    "inference/residual_basis": "ORDER WAVES A_WAVE JUMPS",
    "diagnosis/screening": "DRAWS RARE SAME SEED STRONG ORDINARY NEAR_BY ABSORBED APART STARTS",
    "diagnosis/search": "FIRST_ORDER WIDTH BEAM PAIRS RIVAL START_WITHIN FAINT MOST_CAUSES CARRIED_ON",
    "inference/refit": "WORSE",
    "inference/trust_region": "ROUNDS STEPS HALVINGS ENOUGH LEARNT RENEWED PATIENT HOPE LOST POOR GOOD "
    "SHRINKS GROWS SMALLEST",
    "inference/truncated_normal": "CHAINS SWEEPS SETTLING SEED FAR",
    "diagnosis/unmodelled": "SIZES OVERLAP",
    "diagnosis/verdict": "RIVALS",
    "calibration/calibrated_model": "ALIKE",
    "calibration/carried": "STEP",
    "calibration/design": "READINGS",
    "calibration/fit": "ROUNDING ROUNDS SETTLED MISFIT",
    "calibration/joint": "NOTHING",
    "calibration/identifiability": "UNSEEN SHARE NEGLIGIBLE TINY",
    "calibration/profile": "CHI2_95 REACHED MOST_TRIALS",
    "calibration/results": "STEP AT_BOUND",
    "diagnosis/experiment": "PER_RAMP FURTHER FARTHEST HELD WANTED MOST HELPS CONTENDERS BETTER SMALL SHORT_OF "
    "UNKNOWN",
}
"""Steps, iteration limits, tolerances, seeds, quantiles, and what is tried of an endless list: more of each costs
time and moves a result by less than its interval."""

SHOWN = {
    "diagnosis/column": "GONE",
    "diagnosis/column_kind": "MANY",
    "diagnosis/run": "SHOWN",
    "diagnosis/critical": "FURTHER",
    "diagnosis/figures": "MOST_POSTURES THRESHOLD TICKS LETTER",
    "diagnosis/ramp_kind": "MOST_PAIRS",
    "diagnosis/summary_text": "ANY_DIRECTION",
    "calibration/figures": "LETTER MOST_NAMED EDGE STRONG",
    "calibration/parameters": "MATRIX",
    "calibration/results": "SOURCES",
    "calibration/summary_text": "DIGITS WIDTH",
}
"""What a page or a line of text shows."""


def numbers(path: Path) -> set[str]:
    """Upper-case names of a module's own numbers."""
    found = set()
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None:
            continue
        target = node.targets[0] if isinstance(node, ast.Assign) else node.target
        names = [n.id for n in ast.walk(target) if isinstance(n, ast.Name)]
        values = [n.value for n in ast.walk(node.value) if isinstance(n, ast.Constant)]
        if all(name.isupper() for name in names) and values and not any(isinstance(v, str) for v in values):
            found.update(names)
    return found


def listed(*tables: dict[str, str]) -> list[tuple[str, str]]:
    rows = chain.from_iterable(table.items() for table in tables)
    return [(module, name) for module, names in rows for name in names.split()]


def test_every_number_stands_in_one_list():
    found = {
        (f"{folder}/{path.stem}", name)
        for folder in ("observation", "inference", "diagnosis", "calibration")
        for path in (SOURCES / folder).glob("*.py")
        for name in numbers(path)
    }
    known = listed(TUNED, PRIORS, NUMERICS, SHOWN)
    assert len(known) == len(set(known))
    assert sorted(found - set(known)) == [], "say of a new number which list it belongs to"
    assert sorted(set(known) - found) == [], "these are gone: take them out of their list"


def test_no_more_numbers_are_tuned_than_there_were():
    assert len(listed(TUNED)) <= MOST_TUNED
