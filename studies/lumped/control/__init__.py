"""A closed loop of voltage and deflection, designed on the lumped model and run against films.

``controller.py`` is the controller, ``loop.py`` its margins, ``design.py`` how it is found,
``plants.py`` what it drives, ``run.py`` the run and what it tells, ``result.py`` how that is
stored.
"""
