"""Pages, figures and tables, drawn from results; nothing is computed here.

``rebuild.py`` lists what is drawn of which result, ``plots.py`` and ``tables.py`` what Python users
get of one. Figures of a command are in ``figures/``, pages in a folder of their own, with their
sentences in templates. ``look.py`` and ``scales.py`` are for all; ``schema.py`` and
``reference.py`` write pages of the documentation from the ``Key`` of fields.
"""
