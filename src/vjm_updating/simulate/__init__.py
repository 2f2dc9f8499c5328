"""Readings of a machine with a hidden effect, as a test would take them: to plan it, and to try a diagnosis."""
