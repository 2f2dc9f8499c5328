"""Derivatives of wrenches and critical points by the parameters of a chain."""
