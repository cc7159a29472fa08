"""Studies of films: the questions that the finite elements answer, and their results.

A case (``case.py``) is one specimen under one load; motion in time is in ``trace.py``. Every other
file or package is a study. Its result contains everything computed, and saves and loads itself. A
``Key`` gives the meaning of each field of a result. Nothing here draws or prints.
``pyproject.toml`` lists the allowed imports, under "the studies' floors".
"""
