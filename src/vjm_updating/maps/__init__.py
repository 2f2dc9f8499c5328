"""Maps over a manipulator's workspace: stiffness, critical forces and deflections on a grid of poses."""
