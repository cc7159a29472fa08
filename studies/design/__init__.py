"""Films for requirements: what is wanted, what is given, and the films that fulfil it.

``quantities`` are what may be wanted of films, ``requirements`` the file. ``space`` has the films
that may be built, of a family of reduced ones; ``search`` looks among them, by the search of
:mod:`tympan.studies.optimise`. ``scatter`` makes margins of tolerances, ``exact`` solves what was
found by finite elements, ``design`` puts these together, ``result`` is what is stored.
"""
