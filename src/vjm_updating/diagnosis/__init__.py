"""Given measured data: what the model gets wrong, the cause, the extended model and the gain."""
