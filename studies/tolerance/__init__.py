"""Tolerances: how deflection, stroke, force and capacitance of a film's copies scatter, and why.

``given.py`` says how far numbers scatter, ``drawn.py`` draws films, ``shares.py`` divides the
variance among what scatters, ``tolerance.py`` solves them by a family of reduced films, and
``result.py`` is what is stored.
"""
