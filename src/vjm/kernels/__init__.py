"""Compiled kernels: a machine as flat arrays, and its equilibria at a cost linear in its springs.

An equilibrium goes through them in this order:

- `arrays`: what kernels take and write. `statics`: kinematics and loads at a state.
- `elimination`: springs are eliminated from the leaves to the ground; `beam_column` is one of their laws.
- `border`: closures' wrenches and coordinates without springs, and the stiffness (18).
- `newton`: steps until the residual is small. `derivatives`: changes by values of joints and by forces.
- `entry_points`: what Python calls. `machine_solver`: the states of one machine, with everything asked of them.

`compilation` keeps what was compiled; `compiling` tells who waits for it.
"""
