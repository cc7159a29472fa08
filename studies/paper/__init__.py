"""Statements of the source paper: its actuators, Table 1, Table 2, published numbers."""
