"""What a part's compliance is, and which beam a compliance is: from virtual experiments, and from matrices.

`experiments` and `solid_part` make a compliance, `matrix_file` reads one; `beam_fit` finds the beam behind it and
`rounding` what printed digits leave open. `command` is what is asked, `report` what is said.
"""
