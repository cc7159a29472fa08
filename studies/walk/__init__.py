"""Points of a film's way, and limit states that it passes between them.

``film_point.py`` has a film at a point, as limit states look at it; ``spread.py`` how far a limit
may be off for the mesh. Steppers are in ``fem/equilibrium/``; which limit states change between two
points of one, ``passed`` in ``fem/results/limit_states.py`` enumerates.
"""
