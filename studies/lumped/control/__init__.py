"""A closed loop of voltage and deflection, designed on the lumped model and run against films.

``controller.py`` is the controller, ``loop.py`` its margins, ``design.py`` how it is found,
``run.py`` the run and what it shows, ``result.py`` how that is stored. What it drives are the
plants of :mod:`tympan.studies.lumped.plants`.
"""
