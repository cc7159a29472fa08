"""The paper's figures computed again, and what is wrong in it.

``missing_parameters.py`` finds what Table 1 lacks, ``figures.py`` computes the figures with it,
``findings.py`` shows each error by a computation, and ``output.py`` is the result. What the paper
prints is in ``studies/paper``.
"""
