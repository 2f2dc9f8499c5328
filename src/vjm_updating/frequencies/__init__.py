"""Machines calibrated by their natural frequencies, read by tapping them in several postures.

`measurement` reads, `plausibility` judges what was read, `forward` predicts, `calibration` fits.
"""
