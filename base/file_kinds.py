"""Kinds of TOML files, recognised by their tables, so that a message names the kind given."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tympan.base.command_line import file_word
from tympan.base.errors import InputError

Content = Mapping[str, Any]

#: Keys of a rig that no other file has at its top.
_OF_RIG = frozenset(("bias", "spring", "amplifier_gain", "sag_voltage", "sensor_gain",
                     "sensor_zero", "sensor_lag", "guide", "friction", "unaccounted_mass"))


@dataclass(frozen=True)
class FileKind:
    """A kind of file: its words, how it is recognised, how to get one, and what takes it.

    ``made`` may name the specimen's ``{file}``.
    """

    words: str
    known: Callable[[Content], bool]
    made: str
    taken: str


#: Kinds of files by name; a file is of the first kind that recognises it.
KINDS: dict[str, FileKind] = {
    "lumped model": FileKind(
        "a lumped model", lambda data: "circle" in data and isinstance(data.get("specimen"), dict),
        "tympan lumped build {file} -o DIR writes one",
        "tympan lumped export, simulate and control take it"),
    "specimen": FileKind(
        "a specimen", lambda data: all(isinstance(data.get(key), dict)
                                       for key in ("frame", "membrane")),
        "it has a name and the tables [frame], [plate] and [membrane]",
        "tympan solve, limits, curve and others take it"),
    "requirements": FileKind(
        "requirements", lambda data: "specimen" in data and ("want" in data or "vary" in data),
        'it names a specimen, specimen = "{file}", and has the tables [want] and [vary]',
        "tympan design takes it"),
    "dataset": FileKind(
        "a dataset", lambda data: isinstance(data.get("specimen"), list)
        and all(isinstance(entry, dict) for entry in data["specimen"]),
        "it stands in a folder with CSV files of readings, and has a table [[specimen]] for each "
        'specimen, such as file = "{file}"',
        "tympan data and tympan diagnose take its folder"),
    "study": FileKind(
        "a study", lambda data: "specimens" in data,
        'it lists its specimens, specimens = ["{file}"]', "tympan study takes it"),
    "sweep": FileKind(
        "a sweep", lambda data: "specimen" in data and not {"grid", "list", "sample"}.isdisjoint(
            data),
        'it names a specimen, specimen = "{file}", its mass and voltage, and the keys to vary in '
        "a table [grid]", "tympan sweep takes it"),
    "rig": FileKind(
        "a rig", lambda data: not _OF_RIG.isdisjoint(data) and not {"specimen", "frame"} & {*data},
        "it has keys such as gravity, spring or [[bias]]", "the option --rig takes it"),
    "tolerances": FileKind(
        "tolerances", lambda data: False,
        "it has tables such as [film] and [batch]", "the option --tolerances takes it"),
}


def of_kind(kind: str, data: Content) -> bool:
    """Check whether a file's content is recognised as this kind first."""
    return next((name for name, each in KINDS.items() if each.known(data)), "") == kind


def require_kind(file: Path | str, data: Content, kind: str) -> None:
    """Refuse a file that is recognised as another kind than the one needed."""
    found = next((name for name, each in KINDS.items() if each.known(data)), "")
    if not kind or not found or found == kind:
        return
    given, needed = KINDS[found], KINDS[kind]
    specimen = file_word(Path(file).name) if found == "specimen" else "film.toml"
    raise InputError(f"is the file of {given.words}, not of {needed.words}: {given.taken}. For a "
                     f"file of {needed.words}: {needed.made.format(file=specimen)}", file=file)
