"""Robots measured by how they deflect under known loads: postures, wrenches, loaded minus unloaded displacements."""
