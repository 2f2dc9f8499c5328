"""`validate all`: which comparisons there are; the runs on the paper's chain and on one's own machine."""

from __future__ import annotations

COMPARISONS = {
    "chain": "force-displacement paths of every engine in postures A to D, both directions",
    "table2": "every figure of the paper's Table II, and what the rounding of its inputs can reach",
    "link_lumping": "critical force against number and placement of the bar's springs",
    "end_conditions": "critical points under dead loads and with free rotations, and what imperfections cost",
    "robots": "whole robots against finite elements: stiffness, critical forces, errors of assembly, mobility",
    "discovery": "finite elements' readings under the paper's model, diagnosed: what is wrong, and the gain",
    "verification": "cases with a known answer on every engine; with chain, a second finite element program",
}
"""What ``--only`` can pick."""
