"""Machines calibrated by their natural frequencies, read by tapping them in several postures."""
