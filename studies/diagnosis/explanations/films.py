"""Films that differ from their description: impossible ones, or one specimen of several."""

from __future__ import annotations

import numpy as np

from tympan.studies.data.findings import Finding
from tympan.studies.diagnosis.explanations.kind import Explanation, Written
from tympan.studies.diagnosis.hypothesis import FACTORS
from tympan.studies.diagnosis.inference.verdict import Judgement
from tympan.studies.diagnosis.patterns.reading_patterns import check_of_pattern
from tympan.studies.diagnosis.sentences import WORDS


def no_such_film(judged: Judgement, written: Written | None = None) -> Explanation | None:
    """Report factors on stiffness and permittivity that hardly any film has."""
    if not judged.unusual:
        return None
    factors = np.exp((judged.chosen or judged.nominal).unknowns[FACTORS])
    return Explanation.of(Finding("film", WORDS["unusual"].format(factors=factors),
                                  check=WORDS["do_film"]))


def odd_specimen(judged: Judgement, written: Written | None = None) -> Explanation | None:
    """Name the specimen that is the only one the simulation misses."""
    name = judged.weighed.odd_specimen
    if not name:
        return None
    return Explanation(WORDS["odd_specimen"].format(specimen=name),
                       check_of_pattern(f"specimen {name}"))
