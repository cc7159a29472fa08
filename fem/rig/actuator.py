"""An actuator: a specimen with the rig that it is on, as one file may state both."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Self

from tympan.base.errors import InputError
from tympan.base.fields import Key, Special, fields_of, read, takes_units
from tympan.base.toml_reader import Table
from tympan.fem.film.library import READERS
from tympan.fem.rig.rig import Rig
from tympan.geometry.specimen import Specimen

#: Rig of a specimen that states none. Where this object is the default of an argument, the
#: specimen's own rig is meant; another ideal rig that is given replaces that.
OWN = Rig()


@takes_units
@dataclass(frozen=True)
class Actuator(Specimen):
    """Specimen with its ``rig``; a rig that a question gives replaces it."""

    rig: Annotated[Rig, Key(
        "what else acts on film and plate: keys of RIG.toml, or the name of such a file; a rig "
        "that a question gives replaces it")] = OWN

    @classmethod
    def of(cls, specimen: Specimen, rig: Rig) -> Self:
        """Put a specimen on a rig."""
        return cls(**_parts(specimen), rig=rig)

    @property
    def bare(self) -> Specimen:
        """The specimen without its rig."""
        return Specimen(**_parts(self))


def _parts(specimen: Specimen) -> dict[str, Any]:
    return {field.name: getattr(specimen, field.name) for field in fields_of(Specimen)}


def rig_under(table: Table, key: str = "rig") -> Rig | None:
    """Read a rig under a key, its keys or the name of their file; None where there is none."""
    return None if table.value(key, None) is None else Rig.from_table(table.table_or_file(key))


_READERS: Special = {**READERS, (Actuator, "rig"): lambda table, key: rig_under(table, key) or OWN}


def load_actuator(source: Table | Path | str) -> Specimen:
    """Read the specimen of a TOML file or table: an :class:`Actuator` if it has a table [rig]."""
    table = source if isinstance(source, Table) else Table.read(source, "specimen")
    actuator: Actuator = read(Actuator, table, _READERS)
    return actuator if "rig" in table else actuator.bare


def mounted(specimen: Specimen, rig: Rig | None = None) -> tuple[Specimen, Rig]:
    """Separate a specimen from its rig; a ``rig`` that is given replaces that.

    A specimen that has none is on an ideal one.
    """
    bare, own = ((specimen.bare, specimen.rig) if isinstance(specimen, Actuator)
                 else (specimen, OWN))
    return bare, own if rig is None or rig is OWN else rig


def mounted_together(specimens: Sequence[Specimen], rig: Rig | None = None
                     ) -> tuple[tuple[Specimen, ...], Rig]:
    """Separate specimens from the one rig that all are on; a ``rig`` that is given replaces it.

    Raises
    ------
    InputError
        When the specimens state different rigs and no ``rig`` is given.
    """
    pairs = [mounted(specimen, rig) for specimen in specimens]
    rigs = [on for _, on in pairs]
    other = next((bare.name for bare, on in pairs if on != rigs[0]), "")
    if other:
        raise InputError("must be one for all these specimens, and their files state different "
                         "ones: give a rig, which replaces them", key="rig",
                         given=f"those of {pairs[0][0].name} and {other}")
    return tuple(bare for bare, _ in pairs), rigs[0] if rigs else rig or OWN
