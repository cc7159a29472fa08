"""Films for requirements: what is wanted, what is given, and the films that fulfil it.

``quantities`` are what may be wanted of films, ``requirements`` the file, ``ranges`` what may be
chosen, and ``sqp`` the steps of the search, which know no film. ``space`` has reduced films of a
family, ``search`` looks among them, ``scatter`` makes margins of tolerances, ``exact`` solves what
was found by finite elements, ``design`` puts these together and ``result`` is what is stored.
"""
