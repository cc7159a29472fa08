"""Files from outside are read whole, here alone: regular files, of a bounded size."""

from __future__ import annotations

import stat
from contextlib import suppress
from itertools import islice
from pathlib import Path, PurePosixPath

from tympan.base.errors import InputError, did_you_mean

#: Most bytes of a file that a person writes, far more than anyone types.
WRITTEN = 4_000_000
#: Most bytes of a table, a drawing or a result. A bound of the memory that one file may take.
STORED = 100_000_000

#: So many folders up a file may name another one: the draft of a dataset in data/set/ names tables
#: in raw/ so. Further up are files of other people.
_UP = 2

#: So many files of a folder are looked at for one that was meant: their names take 0.1 s.
_LISTED = 2000


def file_bytes(file: Path | str, most: int = STORED) -> bytes:
    """The bytes of a regular file.

    Raises
    ------
    InputError
        When it is missing, no regular file (a device or a pipe may never end), longer than
        ``most`` bytes, or cannot be read.
    """
    file = Path(file)
    try:
        state = file.stat()
        if stat.S_ISREG(state.st_mode) or file.is_dir():
            with file.open("rb") as stream:
                # Room for all that it asks is taken at once; what a system makes says it has none.
                content = stream.read(min(state.st_size or most, most) + 1)
        else:
            content = None
    except OSError as error:
        near = near_name(file) if isinstance(error, FileNotFoundError) else ""
        raise InputError(f"cannot be read: {error.strerror}{near}", file=file) from None
    except ValueError:
        raise InputError("cannot be read: no file has NUL in its name", file=file) from None
    if content is None:
        raise InputError("cannot be read: it is no regular file", file=file)
    if len(content) > most:
        raise InputError(f"cannot be read: it is longer than {most / 1e6:g} MB", file=file)
    return content


def beside(folder: Path | str, name: str) -> Path:
    """The file that a file in a ``folder`` names.

    Raises
    ------
    InputError
        When the name is no relative path, or leads further up than two folders: what somebody else
        wrote must not read any file of the user's.

    Examples
    --------
    >>> beside("data/set", "../oval.toml").as_posix()
    'data/set/../oval.toml'
    """
    path = PurePosixPath(name)
    below = next((at for at, part in enumerate(path.parts) if part != ".."), len(path.parts))
    if path.is_absolute() or below > _UP or ".." in path.parts[below:]:
        raise InputError(f"must be a relative path, at most {_UP} folders up: copy the file "
                         "nearer, or put a link to it there", given=name)
    return Path(folder) / name


def near_name(file: Path) -> str:
    """A question after a message that a file or folder is missing.

    It names what was meant, if that stands beside it, has the same ending and a similar name.
    """
    with suppress(OSError):
        there = (other.name for other in islice(file.parent.iterdir(), _LISTED)
                 if other.suffix == file.suffix)
        hint = did_you_mean(file.name, {name: repr(name) for name in there})
        return f"; {hint}".rstrip() if hint else ""
    return ""


def file_text(file: Path | str, most: int = STORED) -> str:
    """The text of a file in UTF-8, without a byte-order mark, its lines ended by line feeds."""
    try:
        text = file_bytes(file, most).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"is not UTF-8 text (byte {error.start})", file=file) from None
    return text.replace("\r\n", "\n").replace("\r", "\n")
