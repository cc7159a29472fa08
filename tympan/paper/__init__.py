"""The source paper: its printed numbers, its figures computed again, and its errors.

``published.py``, ``table1.py`` and ``table-2`` hold its numbers. ``missing_parameters.py`` finds
what Table 1 lacks, ``figures.py`` computes the figures with it, ``findings.py`` shows each error by
a computation, ``output.py`` is the result and ``page.py`` its page (``tympan lumped paper``).
"""
