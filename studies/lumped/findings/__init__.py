"""What is wrong or missing in the paper, each shown by a computation."""

from __future__ import annotations

from studies.lumped.findings.checks import checks
from studies.lumped.findings.finding import Finding, Number
from studies.lumped.findings.kinematics import cone, energy
from studies.lumped.findings.law import softening
from studies.lumped.findings.signs import sign
from studies.lumped.findings.table2 import lost_cells, mass_ratio
from studies.lumped.replica import Replica

__all__ = ["Finding", "Number", "findings"]


def findings(found: Replica) -> tuple[Finding, ...]:
    """All of them, with the lost parameters and the ranges of a replica."""
    lost = found.lost
    return (sign(lost), softening(lost), cone(lost),
            lost_cells(found.fits["rest"], found.others, found.smallest_worst, found.allowed, found.fits["levels"]),
            mass_ratio(lost, found.rest_ranges, found.level_ranges, found.random_ranges), energy(lost), checks())
