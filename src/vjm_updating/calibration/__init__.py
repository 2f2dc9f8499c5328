"""Calibration by ramps, loads and tests of one joint: compliances from readings, with their uncertainty.

`parameters` says what is looked for, `fit` finds it, `design` predicts with it and proposes the next test,
`calibrated_model` writes it as a model file. `run` leads through, `document` and `page` say it. `joint` is the test
of one joint.
"""
