"""The verification hierarchy: cases with known answers, and how near every engine comes to them by which order.

A case is a TOML file in ``vjm_validation/cases``: what is asked, of which chain under which load case, the answer
with its source, and how near each engine has to come and why. Before the lumped model and the finite elements are
compared with each other, each passes the hierarchy on its own. That the answers are those of mathematics, or of
other programs, makes this verification; whether a machine does the same is validation, and measurements decide it.
"""
