"""An explanation of a misfit by the data alone, and the input of the search for one."""

from __future__ import annotations

from dataclasses import dataclass

from tympan.studies.data.dataset import Dataset
from tympan.studies.data.findings import Finding
from tympan.studies.diagnosis.evidence.kind import PreparedReadings


@dataclass(frozen=True)
class Explanation:
    """Fault of the data that would explain a misfit: a sentence, and what to do about it.

    ``finding``: the fault in the dataset that is to be corrected; None where the sentence only says
    where to look.
    """

    what: str
    check: str
    finding: Finding | None = None

    @classmethod
    def of(cls, finding: Finding) -> Explanation:
        """Build the explanation from a fault in the dataset."""
        return cls(finding.what, finding.check, finding)


@dataclass(frozen=True, eq=False)
class Written:
    """Files as they are written, and the readings made of them."""

    dataset: Dataset
    readings: PreparedReadings
