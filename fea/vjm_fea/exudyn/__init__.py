"""The parts of a chain as geometrically exact beams, solved with Exudyn."""
