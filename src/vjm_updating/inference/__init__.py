"""What calibration and diagnosis share: unknowns, forward model of the readings, fit, outliers, noise."""
