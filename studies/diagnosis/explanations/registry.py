"""Every explanation of a misfit by the data alone: a new one is a file here and a line below.

They are weighed by :mod:`~tympan.studies.diagnosis.inference.weighing` and sought in the order of
the list. A later one is more general: a separate film for one specimen fits whatever other labels
or another size of this specimen fit. So by probability alone the last one would always be taken.
"""

from __future__ import annotations

from collections.abc import Callable

from tympan.studies.diagnosis.explanations.films import no_such_film, odd_specimen
from tympan.studies.diagnosis.explanations.kind import Explanation, Written
from tympan.studies.diagnosis.explanations.labels import wrong_labels
from tympan.studies.diagnosis.explanations.quantities import mistaken_quantity
from tympan.studies.diagnosis.explanations.runs import odd_run
from tympan.studies.diagnosis.inference.verdict import Judgement

#: Function that seeks an explanation for a judgement. Without files it does not know how numbers
#: are written.
Seeks = Callable[[Judgement, Written | None], Explanation | None]

#: Explanations in the order in which they are sought: the first that is found is reported.
#: :func:`~tympan.studies.diagnosis.explanations.frames.other_frame` is sought before the verdict.
EXPLANATIONS: tuple[Seeks, ...] = (
    wrong_labels, mistaken_quantity, no_such_film, odd_run, odd_specimen)


def explanation_of(judged: Judgement, written: Written | None = None) -> Explanation | None:
    """Find the first explanation by the data alone; None if nothing is wrong or none applies."""
    if judged.verdict == "nothing":
        return None
    found = (seek(judged, written) for seek in EXPLANATIONS)
    return next(filter(None, found), None)
