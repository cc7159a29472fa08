"""Equilibria: Newton's method, constraints, ramps and arc length."""
