"""Measured data: datasets, their columns, readings and noise."""
