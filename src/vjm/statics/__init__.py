"""Static equilibrium, its stability and its stiffness: equations (5) to (18)."""
