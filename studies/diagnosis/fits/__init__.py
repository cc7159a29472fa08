"""Fits of hypotheses to readings, and the probability of the readings under each."""
