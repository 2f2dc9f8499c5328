"""Any machine as one tree of parts with closed loops, in one posture or in many at once.

- `rigid_mechanism`, with its kernels in `rigid_kernel`: frames, how loops close, mobility.
- `inverse_kinematics`: joints that put an end frame where it is wanted.
- `equilibria`: loaded postures with their stiffness.
- `critical_force`, on `critical_search`: the smallest force under which stability is lost.
- `platforms`: errors of assembly, and what legs bear.
"""
