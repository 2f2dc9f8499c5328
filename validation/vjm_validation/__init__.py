"""Comparisons of the lumped model with finite elements and with published figures, and their report."""
