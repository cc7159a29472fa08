"""Transients as readings: what is wrong with a run, means of its blocks, what its swings say."""
