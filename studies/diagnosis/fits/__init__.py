"""Hypotheses fitted to readings, and how probable the readings then are."""
