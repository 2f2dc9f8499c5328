"""What calibration and diagnosis share, from the readings to the fit.

- `observed`: readings as arrays, with their `noise`. `instruments`: errors of what was read.
- `parameters`: what is looked for, with prior and bounds.
- `forward`, `load_forward`, `joint_forward`: the readings that a hypothesis predicts.
- `fitting`: the most probable parameters; `refit`: again, with the outliers and the noise found about them.
- `profile`: the interval of one parameter, the others fitted.
- `model_error`: laws that are right to some per cent only. `significance`: what is too rare to be an accident.
- `bounded_normal`: normal distributions within bounds.
"""
