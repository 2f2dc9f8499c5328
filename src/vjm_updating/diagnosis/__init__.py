"""Given measured data: what the model gets wrong, the cause, the extended model and the gain.

Readings pass from top to bottom:

- `kinds`, `ramp_kind`, `column`: what a kind of test asks for.
- `preprocess`: nominal fit, outliers, noise, catalogue.
- `screening`: which causes could explain the residual. `search`: sets of causes, by `evidence` and `discrepancy`.
- `verdict`: none, named, class or unknown. `holdout`: the gain on readings that no fit had seen.
- `experiment`: the next test. `stress`: where the material yields.
- `run` leads through; `document`, `figures`, `page` and `summary_text` say it.
"""
