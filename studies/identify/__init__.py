"""The lumped model's constants from readings at rest and in time.

``static.py`` and ``dynamic.py`` set up the two fits, whose search and limits are those of
``studies/estimation``. ``responses.py`` reads runs of a dataset, ``correlation.py`` finds how many
correlated readings count as one, and ``result.py`` is printed, saved and drawn.
"""
