"""Films for requirements: what is wanted, what is given, and the films that fulfil it.

The quantities that may be wanted are in ``studies/wanted.py``. ``requirements`` reads the file,
``ranges`` holds the free numbers, and ``sqp`` takes the steps of the search, independent of films.
``space`` has the reduced films of a family, ``search`` searches among them, ``scatter`` finds
margins from tolerances, and ``exact`` solves the films found by finite elements. ``relaxed`` finds
weaker bounds that films can keep, ``front`` trades two quantities off. ``design`` joins these
steps, and ``result`` is stored.
"""
