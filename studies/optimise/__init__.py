"""Shape optimisation: the largest stroke that stress, field, pull-in and gap leave.

``problem.py`` reads OPTIMISE.toml, ``design.py`` computes a design with its derivatives
(``state.py`` at one voltage, ``cycle.py`` over all, ``end.py`` to the film's end), ``sqp.py`` is
the search, which knows no film, and ``optimise.py`` the result. A limit is added in ``limits.py``.
"""
