"""What every finite element engine shares: equilibrium paths, points, loads, statics of beams."""
