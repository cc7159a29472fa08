"""A closed loop of voltage and deflection, designed on the lumped model and run against films.

``controller.py`` is the controller, ``loop.py`` its margins, ``design.py`` finds it, ``run.py``
runs it, and ``result.py`` stores the results. It drives the plants of
:mod:`tympan.studies.lumped.plants`.
"""
