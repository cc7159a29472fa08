"""Reduced films with few shapes and points, as accurate as the field model they are made from.

``reduction``: shapes and points from finite-element states, for one film or a family. ``film``: the
reduced film. ``motion`` and the modules that it imports: its motion in time. ``family``: many films
with different parameters within a ``box``, and the error of each film. ``check`` estimates this
error. ``many_films`` solves all films at once, at ``sites``. ``population``: films on a rig, each
with its load, supply and strength. ``states``: their results under loads. ``sampling``:
extrapolation of motions. Law, voltage and branches come from ``fem``; nothing is fitted.
"""
