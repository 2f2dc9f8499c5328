"""Calibration: spring compliances from measured readings, with their uncertainty."""
