"""Maps over a manipulator's workspace: stiffness, critical forces and deflections on a grid of poses.

`grid` lists the poses, `evaluate` answers at each, `run` spreads them over processes and keeps what is finished,
`output` and `pictures` write files.
"""
