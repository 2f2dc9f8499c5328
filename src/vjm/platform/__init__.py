"""Whole manipulators: chains between a base, a platform and the bodies between them."""
