"""The observation model that calibration and diagnosis share: readings, their noise, errors of the instruments."""
