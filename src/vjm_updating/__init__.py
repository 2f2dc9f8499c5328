"""What measured data say of a model: calibration, diagnosis, identification of parts, maps."""
