"""Points of a film's path, and the limit states that it reaches between them.

``film_point.py`` provides limit states with the film at a point. ``spread.py`` estimates the mesh
error of a limit. Path following is in ``fem/equilibrium/``. ``passed`` in
``fem/results/limit_states.py`` lists the limit states that change between two points.
"""
