"""The parts of a chain as geometrically nonlinear beams, and parts as solids, solved by finite elements."""
