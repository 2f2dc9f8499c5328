"""The parts of a chain as geometrically nonlinear beams, solved by finite elements."""
