"""Diagnosis: what measured data say the simulation gets wrong, which effect explains it, and what it would gain."""
