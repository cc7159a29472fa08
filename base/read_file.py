"""Reading of files from outside: whole, regular files of a bounded size."""

from __future__ import annotations

import stat
from contextlib import suppress
from itertools import islice
from pathlib import Path, PurePosixPath

from tympan.base.errors import InputError, did_you_mean

#: Most bytes of a file that a person writes: far more than anyone types.
WRITTEN = 4_000_000
#: Most bytes of a table, a drawing or a result. It bounds the memory that one file may take.
STORED = 100_000_000

#: Most folders upwards in the name of another file: the draft of a dataset in data/set/ names
#: tables in raw/ this way. Files further up belong to other people.
_UP = 2

#: Most files of a folder that are compared with a missing name: their names take 0.1 s.
_LISTED = 2000


def file_bytes(file: Path | str, most: int = STORED) -> bytes:
    """Read the bytes of a regular file.

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
                # The read allocates all its size at once; a file made by the system states size 0.
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
    """Locate the file that a file in a ``folder`` names.

    Raises
    ------
    InputError
        When the name is not a relative path, or leads further up than two folders: a file from
        somebody else must not read any file of the user's.

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
    """Ask, after a message that a file or folder is missing, whether a similar name was meant.

    The name offered stands in the same folder, with the same ending.
    """
    with suppress(OSError):
        there = (other.name for other in islice(file.parent.iterdir(), _LISTED)
                 if other.suffix == file.suffix)
        hint = did_you_mean(file.name, {name: repr(name) for name in there})
        return f"; {hint}".rstrip() if hint else ""
    return ""


def file_text(file: Path | str, most: int = STORED) -> str:
    """Read a UTF-8 text file without its byte-order mark, with lines ended by line feeds."""
    try:
        text = file_bytes(file, most).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"is not UTF-8 text (byte {error.start})", file=file) from None
    return text.replace("\r\n", "\n").replace("\r", "\n")
