"""Diagnosis: where the simulation misses measured data, which effect explains it, the gain."""
