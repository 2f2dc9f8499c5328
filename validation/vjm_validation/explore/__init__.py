"""A machine to turn in one's hands: what its sliders set, what it answers, and the page that shows it."""
