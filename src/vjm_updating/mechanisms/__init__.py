"""What a machine may do that its model lacks.

- `effect` says what a cause is; `catalogue` lists those that there are and takes more.
- `structure`, `loads`, `drives`, `contacts`, `hysteresis` hold the causes.
- `modified_chain` is a machine with causes in it, on `equilibrium_tables` and `joint_motions`;
  `series_elements` and `relaxation` are what is built in, `history_kernels` what is compiled, `column` a machine of
  its own.
"""
