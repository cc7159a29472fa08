"""Films for requirements: what is wanted, what is given, and the films that fulfil it.

``quantities`` are what may be wanted of films, ``requirements`` the file, ``ranges`` what may be
chosen, and ``sqp`` the search, which knows no film. There are two ways to it. By reduced films:
``space`` has those of a family, ``search`` looks among them, ``scatter`` makes margins of
tolerances, ``exact`` solves what was found by finite elements, ``design`` puts these together and
``result`` is what is stored. By finite elements alone, where a film is wanted that has no reduced
one, or whose frame keeps its area or length: ``elements``, with the slopes of ``limits``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from tympan.studies.case import Settings

if TYPE_CHECKING:
    from tympan.studies.design.elements.optimise import OptimiseResult
    from tympan.studies.design.requirements import Requirements
    from tympan.studies.design.result import DesignResult


def best_films(requirements: Requirements, settings: Settings = Settings(),
               progress: Callable[[str], None] = lambda words: None, workers: int = 1
               ) -> DesignResult | OptimiseResult:
    """The best films, by the search that the requirements name.

    Several kinds are searched side by side by so many ``workers``, by reduced films.

    Raises
    ------
    InputError
        When these films cannot be searched.
    """
    if requirements.held:
        from tympan.studies.design.elements.optimise import optimise
        from tympan.studies.design.elements.space import ElementSpace

        return optimise(ElementSpace.of(requirements), settings, progress)
    from tympan.studies.design.design import design

    return design(requirements, settings, progress, workers)
