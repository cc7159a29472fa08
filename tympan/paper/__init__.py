"""The source paper: what it prints, its figures computed again, and what is wrong in it.

``published.py``, ``table1.py`` and ``table-2`` hold what it prints. ``missing_parameters.py`` finds
what Table 1 lacks, ``figures.py`` computes the figures with it, ``findings.py`` shows each error by
a computation, ``output.py`` is the result and ``page.py`` its page (``tympan lumped paper``).
"""
