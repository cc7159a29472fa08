"""Tolerances: how deflection, stroke, force and capacitance of a film's copies scatter, and why.

``given.py`` holds the scatter of numbers, ``drawn.py`` draws films, ``shares.py`` divides the
variance among the causes, ``tolerance.py`` solves the films by a family of reduced films, and
``result.py`` is what is stored.
"""
