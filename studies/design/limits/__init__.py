"""Bounds on films of finite elements, with derivatives.

``state`` is a film at one voltage, ``kinds`` what is bounded there, ``cycle`` the same over all
voltages, and ``end`` the margin to the film's end.
"""
