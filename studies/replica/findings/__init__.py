"""What is wrong or missing in the paper, each shown by a computation."""

from __future__ import annotations

from tympan.studies.replica.figures import Replica
from tympan.studies.replica.findings.equations import checks, sign, softening
from tympan.studies.replica.findings.finding import Finding
from tympan.studies.replica.findings.kinematics import cone, energy
from tympan.studies.replica.findings.table2 import lost_cells, mass_ratio

__all__ = ["Finding", "findings"]


def findings(replica: Replica) -> tuple[Finding, ...]:
    """All of them, with the lost parameters and the ranges of a replica."""
    missing = replica.missing
    return (sign(missing), softening(missing), cone(missing),
            lost_cells(replica.fits["rest"], replica.others, replica.smallest_worst,
                       replica.allowed, replica.fits["levels"]),
            mass_ratio(missing, replica.rest_ranges, replica.level_ranges, replica.random_ranges),
            energy(missing), checks())
