"""The exception for a user's wrong input, and the one for any other failure with a message."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from datetime import date, time
from pathlib import Path, PurePath
from typing import Any, Self

#: End of what is said of a former name.
WORKS_STILL = "works until the next minor version"
#: Most characters of a value in a message: about two lines of a terminal.
_LONGEST = 200
#: Most parts of a list that are written out; more would be cut in any case.
_PARTS = 100


class InputError(ValueError):
    """Input that cannot be used, in one line: file, dotted key, what was given, what is allowed.

    Examples
    --------
    >>> str(InputError("must be positive", file="a.toml", key="plate.radius", given="-1 cm"))
    "a.toml: plate.radius: given '-1 cm': must be positive"
    """

    def __init__(self, allowed: str, *, file: Path | str | None = None, key: str | None = None,
                 given: object = None) -> None:
        self.allowed, self.file, self.key, self.given = allowed, file, key, given
        parts = [str(part) for part in (file, key) if part is not None]
        if given is not None:
            parts.append(f"given {_shortened(written(given))}")
        super().__init__(_printable(": ".join([*parts, allowed])))

    def located(self, *, file: Path | str | None = None, key: str | None = None) -> Self:
        """Copy the error with the place of the value; what it already names is kept."""
        return type(self)(self.allowed, file=self.file or file, key=self.key or key,
                          given=self.given)


class VoltageError(InputError):
    """A voltage that the film, or the model of it, does not bear."""


class Failure(RuntimeError):
    """A failure that ends a command with a message though its input is right."""


def did_you_mean(word: str, spelled: Mapping[str, str]) -> str:
    """Ask for the word nearest to a given one, as it is spelled; empty if none is near.

    ``spelled`` may list several words for one name: its synonyms.

    Examples
    --------
    >>> did_you_mean("sovle", {"solve": "'solve'", "run": "'solve'"})
    "did you mean 'solve'? "
    """
    near = nearest_word(word, spelled)
    return "" if near is None else f"did you mean {spelled[near]}? "


def nearest_word(word: str, words: Iterable[str]) -> str | None:
    """Find the word that was probably meant by a mistyped one; None if none is near.

    Capital and small letters are the same: "KV" is near "kV".
    """
    small = {other.casefold(): other for other in reversed([*words])}
    near = difflib.get_close_matches(word.casefold(), small, 1)
    return small[near[0]] if near else None


def written(value: Any) -> str:
    """Write a value as its author wrote it, without Python's words for it.

    Texts and paths are in quotation marks. Numbers of NumPy are written as numbers, arrays as
    lists, dates as in TOML. Any other object is named by its class.

    Examples
    --------
    >>> written(Path("a/.mat")), written([1, Path("b")]), written(date(2026, 11, 28))
    ("'a/.mat'", "[1, 'b']", '2026-11-28')
    >>> written(object()), written({"radius": [1.5]}), written(10**5000)
    ('an object', "{'radius': [1.5]}", 'a number of more than 4300 digits')
    """
    value = value.tolist() if hasattr(value, "tolist") else value
    if value is None:
        return "nothing"
    if isinstance(value, str | PurePath):
        return repr(str(value))
    if isinstance(value, date | time):  # a date with a time is a date
        return value.isoformat()
    if isinstance(value, bool | int | float | complex):
        try:
            return repr(value)
        except ValueError:
            return "a number of more than 4300 digits"
    if isinstance(value, Mapping):
        entries = ", ".join(f"{written(key)}: {written(part)}"
                            for key, part in [*value.items()][:_PARTS])
        return f"{{{entries}}}"
    if isinstance(value, list | tuple):
        parts = ", ".join(map(written, value[:_PARTS]))
        return f"[{parts}]" if isinstance(value, list) else f"({parts})"
    return one(value if isinstance(value, type) else type(value))


def one(kind: Any) -> str:
    """Write a class as a noun with its article.

    Examples
    --------
    >>> one(Path), one(int), one(InputError)
    ('a Path', 'an int', 'an InputError')
    """
    name = str(getattr(kind, "__name__", kind))
    return f"{'an' if name[0] in 'aeiouAEIOU' else 'a'} {name}"


def _shortened(text: str) -> str:
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 20]} … {text[-15:]}"


def _printable(text: str) -> str:
    """Escape what cannot be printed in a key or a file's name."""
    return text if text.isprintable() else "".join(
        mark if mark.isprintable() else repr(mark)[1:-1] for mark in text)
