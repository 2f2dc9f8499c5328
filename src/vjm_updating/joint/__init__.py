"""Calibration of one joint by its torque against its angle."""
