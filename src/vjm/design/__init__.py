"""What a designer asks of a loaded machine: what deflects, and how it vibrates."""
