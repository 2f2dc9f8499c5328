"""Machines whose parts branch: equilibria under loads over many postures at once, with K^F and derivatives."""
