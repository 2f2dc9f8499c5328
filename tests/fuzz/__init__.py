"""Mutated files for every loader: a result or one line, never a traceback, never a hang."""
