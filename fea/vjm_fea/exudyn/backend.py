"""Exudyn as an untyped module: its type stubs do not fit its calls."""

from __future__ import annotations

from typing import Any

import exudyn
import exudyn.itemInterface

exu: Any = exudyn
items: Any = exudyn.itemInterface
Item = Any
"""The number of a node, marker or object in Exudyn's system."""
Description = Any
"""What Exudyn makes a node, marker or object from, or its settings."""
System = Any
"""A main system of Exudyn."""
