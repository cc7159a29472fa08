"""Films reduced to a few shapes and points, as exact as their field model on what made them.

``reduction``: shapes and points from states of finite elements, for one film or a family of edits.
``film``: the film at these points. ``motion`` and what it imports: that in time, step by step.
``family``: many films that differ in numbers, within a ``box``, with the error of each; ``check``
estimates it, ``many_films`` solves them at once, at ``sites``. ``population``: such films on a rig,
each with its load, supply and strength; ``states``: what is known of them under loads.
``sampling``: motions as samples. Law, voltage and branches come from ``fem``, never from a fit.
"""
