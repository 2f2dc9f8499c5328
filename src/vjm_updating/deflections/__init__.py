"""Robots measured by how they deflect under known loads: displacements, loaded minus unloaded, in many postures."""
