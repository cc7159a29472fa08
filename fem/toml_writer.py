"""Specimens and rigs as TOML that ``solve`` takes and that reads back equal."""

from __future__ import annotations

from tympan.fem.film.admissibility import STRETCH_RANGE, inadmissible_stretch
from tympan.fem.rig import Rig
from tympan.geometry.errors import InputError
from tympan.geometry.fields import Content, write
from tympan.geometry.specimen import Specimen
from tympan.geometry.toml_writer import toml

#: Ranges of stretch to state for a law that is not admissible over all of them, the widest first.
_RANGES = (STRETCH_RANGE, (0.7, 5.0), (0.8, 4.0), (1.0, 4.0), (1.0, 3.0), (1.0, 2.5), (1.0, 2.0),
           (1.0, 1.5))


def specimen_content(specimen: Specimen, plain: bool = False) -> Content:
    """The tables of a specimen file, with the material's ``range`` where it is not the usual one.

    ``plain``: quantities as SI numbers under keys that end with the unit.

    Raises
    ------
    InputError
        When the material is not admissible over any range that holds the prestretch, so that no
        file can state it.
    """
    content = write(specimen, plain)
    material, most = specimen.membrane.material, max(specimen.membrane.prestretch)
    for low, high in _RANGES:
        if high > most and inadmissible_stretch(material, low, high) is None:
            if (low, high) != STRETCH_RANGE:
                content["membrane"]["material"]["range"] = [low, high]
            return content
    raise InputError("cannot be written as a specimen file: true stress falls with stretch near "
                     "the prestretch", key="membrane.material", given=str(material))


def specimen_to_toml(specimen: Specimen) -> str:
    """A specimen file.

    :func:`tympan.fem.film.library.load_specimen` reads the equal specimen from it.
    """
    return toml(specimen_content(specimen))


def rig_to_toml(rig: Rig) -> str:
    """A rig file; :meth:`tympan.fem.rig.Rig.read` reads the equal rig from it.

    Examples
    --------
    >>> print(rig_to_toml(Rig(spring=5.0)).splitlines()[2])
    spring = "5 N/m"
    """
    return toml(write(rig))
