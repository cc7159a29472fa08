"""The paper's lumped model: Eqs. (2)–(10) for any number of circles, at rest and in time.

``actuator.py`` is the model, ``equilibria.py`` where it rests, ``collocation.py`` and
``simulate.py`` its motion, ``linear.py`` its small motions. ``build.py`` makes one of a specimen's
field model and ``model_file.py`` stores it; ``film_response.py`` is for films with branches.
``in_time.py`` is what simulation and control ask of either, and ``plants.py`` either at a moment.
Sentences of all of them are in ``remarks.toml``.
"""
