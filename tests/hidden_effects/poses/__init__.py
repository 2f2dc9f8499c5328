"""Hidden causes in made-up tests of poses, by an energy minimiser that shares nothing with the finder's model."""
