"""The paper's lumped model: Eqs. (2)–(10) for any number of circles, at rest and in time.

- ``actuator.py`` is the model, ``equilibria.py`` finds its equilibria.
- ``collocation.py`` and ``simulate.py`` solve its motion, ``linear.py`` linearises it.
- ``build.py`` builds a model from a specimen's field model; ``model_file.py`` stores it.
- ``film_response.py`` simulates films with viscous branches.
- ``in_time.py`` is the common interface of both kinds of model for simulation and control.
- ``plants.py`` holds either kind at one moment.
- ``remarks.toml`` holds the sentences of all these modules.
"""
