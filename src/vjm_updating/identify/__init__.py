"""What a part's compliance is, and which beam a compliance is: from virtual experiments, and from matrices."""
