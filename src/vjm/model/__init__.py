"""The machine and what is done to it: parts, chain, springs, applied loads, load case, end condition."""
