"""Joints on a bench with causes hidden by formulas that are not the finder's, and how many are found."""
