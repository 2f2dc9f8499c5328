"""Robots measured in many postures: by poses under their own weight, or by deflections under known loads.

Readings pass from top to bottom:

- `measurement`, `deflections`: a test from its files. `plausibility`: mistakes in it.
- `machine`: the robot with a place for every error; `families`: which of them are thought of together.
- `forward`: where the markers are, with derivatives.
- `state`, `fit`, `study`, `pose_study`: a hypothesis and its fit.
- `pooled`: several series in one fit; `changes`: where a series is cut.
- `selection`: which families explain the test. `held_out`: what they predict.
- `identifiability`: what postures tell.
- `verdict`: what is named. `written`: the model file as judged. `run` leads through; `document` and `page` say it.
"""
