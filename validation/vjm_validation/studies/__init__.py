"""The comparisons of `validate all`, and how a run of them is kept."""
