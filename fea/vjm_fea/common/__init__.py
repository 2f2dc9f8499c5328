"""What every finite element engine shares.

`mesh` makes elements of beams, `states` are those of their bodies, `beam_statics` gives residual and tangent,
`linearized_statics` stiffness and stability, `beam_problem` what a path follows, `end_condition` the support.
"""
