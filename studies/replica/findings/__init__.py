"""What is wrong or missing in the paper, each shown by a computation."""

from __future__ import annotations

from tympan.studies.replica.figures import Replica
from tympan.studies.replica.findings.checks import checks
from tympan.studies.replica.findings.finding import Evidence, Finding
from tympan.studies.replica.findings.kinematics import cone, energy
from tympan.studies.replica.findings.law import softening
from tympan.studies.replica.findings.signs import sign
from tympan.studies.replica.findings.table2 import lost_cells, mass_ratio

__all__ = ["Evidence", "Finding", "findings"]


def findings(found: Replica) -> tuple[Finding, ...]:
    """All of them, with the lost parameters and the ranges of a replica."""
    missing = found.missing
    return (sign(missing), softening(missing), cone(missing),
            lost_cells(found.fits["rest"], found.others, found.smallest_worst, found.allowed,
                       found.fits["levels"]),
            mass_ratio(missing, found.rest_ranges, found.level_ranges, found.random_ranges),
            energy(missing), checks())
