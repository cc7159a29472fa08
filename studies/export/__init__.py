"""Files for others: parts to make an actuator, its film as input of a finite-element program."""

from tympan.studies.export.calculix import export_input
from tympan.studies.export.parts import export

__all__ = ["export", "export_input"]
