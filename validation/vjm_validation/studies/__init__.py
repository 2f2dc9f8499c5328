"""The comparisons of `validate all`, and how a run of them is kept.

`chain` and `table2` are those of the paper's chain, `robots` of whole robots, `own_machine` of a user's machine,
and `link_lumping_discovery` is the suite's own discovery.
"""
