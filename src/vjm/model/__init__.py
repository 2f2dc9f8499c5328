"""The machine and what is done to it, as data, and the one mechanism that every command asks.

Data pass from top to bottom:

- `parts`, `machine`: joints, beams and rigid offsets, and the machine that they make.
- `laws`, `springs`: how joints and beams yield.
- `load_case`, `end_condition`: what is imposed, and how the end-effector is held.
- `assembly`: one walk of the parts makes one-degree joints between rigid links; `packing` writes them as arrays.
- `mechanism`: these arrays and the geometry at a configuration. `joint_limits` and `law_states` speak of a state.
- `parameters`: what a machine's behaviour can be differentiated by.
"""
