"""Files in and out: model files, robots' descriptions, paths.

A model file becomes a machine in this order:

- `files`: the text. `schema` with `fields`, `shapes`, `joint_tables`, `body_file`: tables and keys, checked.
- `checks`: what no type can check; `model_plausibility`: what is well-formed and still implausible.
- `model_file`, `manipulator_file`, `machine_file`: the machine. `model_report`: all errors, each with its line.

Other programs' files: `robot_file` asks `urdf`, `sdf`, `mjcf`, `dh_table` or `ur_calibration` for a `robot`, and
`robot_document` writes it as a model; `robot_text` goes the other way. `provenance` says what a result was made of.
"""
