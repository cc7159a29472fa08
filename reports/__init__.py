"""Pages, figures and tables, drawn from results; nothing is computed here.

``rebuild.py`` lists the drawings of each result, ``plots.py`` and ``tables.py`` the picture and the
table that Python users get. Figures of a command are in ``figures/``, pages in a folder of their
own, with their sentences in templates. ``look.py`` and ``scales.py`` serve all figures;
``schema.py`` and ``reference.py`` write pages of the documentation from the ``Key`` of fields.
"""
