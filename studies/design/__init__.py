"""Films for requirements: what is wanted, what is given, and the films that fulfil it.

``quantities`` are what may be wanted of films, ``requirements`` the file, ``ranges`` what may be
chosen, and ``sqp`` the search, which knows no film. There are two ways to it. By reduced films:
``space`` has those of a family, ``search`` looks among them, ``scatter`` makes margins of
tolerances, ``exact`` solves what was found by finite elements, ``design`` puts these together and
``result`` is what is stored. By finite elements alone, where a film is wanted that has no reduced
one, or whose frame keeps its area or length: ``elements``, with the slopes of ``limits``.
"""
