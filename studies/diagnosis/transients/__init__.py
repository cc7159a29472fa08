"""Transients as readings: faults of a run, means of its blocks, and its oscillations."""
