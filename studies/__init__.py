"""Studies of films: what is asked of the finite elements, and what is answered.

A case (``case.py``) is one specimen under one load; what a film does in time is in ``trace.py``.
Every other file or chapter is a study. It answers a result with everything computed, which saves
and loads itself; a field of a result says its meaning by a ``Key``. Nothing here draws or prints.
Who may import whom is in ``pyproject.toml``, "the studies' floors".
"""
