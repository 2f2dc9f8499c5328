"""Files in and out: the model files that describe a machine."""
