"""The folder of a command's results: which files are its own, which command works in it.

``.tympan`` lists every result written there as ``sha256sum`` does, by digest and name. So a file
that somebody put in a result's place, or changed, is not taken for tympan's own. A command locks
this list while it works in the folder.
"""

from __future__ import annotations

import errno
import fcntl
import hashlib
import os
import shutil
import stat
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from functools import cache
from pathlib import Path

from tympan.base.errors import InputError
from tympan.base.process.interruption import signals_wait

#: Name of the list in each folder: digest and name of each file written there, one a line.
MANIFEST = ".tympan"
#: First letters of the names of files that are not yet complete.
TEMPORARY = ".tympan-"

#: First letters of the names of temporary folders; nobody gives such a name to results.
_SCRATCH = f"{TEMPORARY}scratch-"
#: Age up to which a temporary folder may be without a lock, because it was just made [s].
_FRESH = 60.0

#: Most bytes of a manifest: some 100,000 results.
_MOST = 16_000_000
#: Time between two attempts to lock a folder that is in use [s].
_GLANCE = 0.05
#: Earlier content of results, while several are written together: each file that was replaced or
#: removed, and the other name of its content; None where the file did not exist.
_BEFORE: ContextVar[dict[Path, Path | None] | None] = ContextVar("before", default=None)
#: Flags to open a file: do not follow a link, do not wait for a pipe.
_PLAIN = os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
_FOLDER = os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC
#: Errors of file systems without locks: work goes on without a lock.
_NO_LOCKS = (errno.ENOLCK, errno.ENOTSUP, errno.ENOSYS, errno.EINVAL)


def digest_of(file: Path) -> str:
    """Compute the SHA-256 of a regular file; "" if there is none, or something else."""
    try:
        handle = os.open(file, os.O_RDONLY | _PLAIN)
    except OSError:
        return ""
    with os.fdopen(handle, "rb") as stream:
        if not stat.S_ISREG(os.fstat(handle).st_mode):
            return ""
        return hashlib.file_digest(stream, "sha256").hexdigest()


def is_own(file: Path) -> bool:
    """Check that a file is as tympan wrote it; False if it does not exist.

    Raises
    ------
    InputError
        When somebody else wrote or changed it.
    """
    if not os.path.lexists(file):
        return False
    lines = _lines(file.parent / MANIFEST)
    if f"{digest_of(file)}  {file.name}" in lines:
        return True
    reason = "is there already, and no earlier result"
    if any(line.endswith(f"  {file.name}") for line in lines):
        reason = "was changed since tympan wrote it"
    elif file.name in lines:
        reason = "is from an earlier version of tympan, which cannot tell whether it was changed"
    raise InputError(f"{reason}: move it away, or choose another folder", file=file)


def put(temporary: Path, file: Path, listed: bool = True) -> None:
    """Give a complete file its name, and list it unless nobody else gives such names.

    It is listed first: a process that is killed between the two leaves the earlier file, which
    is listed too. Signals wait meanwhile.
    """
    line = f"{digest_of(temporary)}  {file.name}"
    with signals_wait():
        if listed and line not in _lines(file.parent / MANIFEST):
            handle = _open(file.parent / MANIFEST)
            with os.fdopen(handle, "r+b") as stream:
                # A line that a full disk cut off must not take the next one with it.
                end = stream.seek(0, os.SEEK_END)
                begin = "\n" if end and os.pread(handle, 1, end - 1) != b"\n" else ""
                stream.write(f"{begin}{line}\n".encode(errors="surrogateescape"))
        _keep(file)
        temporary.replace(file)


def take_away(file: Path) -> None:
    """Remove a result if it exists."""
    with signals_wait():
        _keep(file)
        file.unlink(missing_ok=True)


def _keep(file: Path) -> None:
    """Keep the content of a result under another name before it is replaced."""
    before = _BEFORE.get()
    if before is None or file in before:
        return
    before[file] = None
    if os.path.lexists(file):
        other = file.with_name(f"{TEMPORARY}{os.getpid()}-{len(before)}{file.suffix}")
        with suppress(FileNotFoundError):  # of another process of this number, which was killed
            other.unlink()
        os.link(file, other, follow_symlinks=False)
        before[file] = other


@contextmanager
def together(folder: Path) -> Iterator[None]:
    """Write all results of a block into a folder, or none.

    A failure restores the earlier results and their list. Copies of them need no disk space.
    """
    before: dict[Path, Path | None] = {}
    manifest = folder / MANIFEST
    listed = manifest.stat().st_size if manifest.is_file() else 0
    token = _BEFORE.set(before)
    try:
        yield
    except BaseException:
        with signals_wait():
            for file, other in before.items():
                with suppress(OSError):
                    if other is None:
                        file.unlink(missing_ok=True)
                    else:
                        other.replace(file)
            with suppress(OSError):
                os.truncate(manifest, listed)
        raise
    finally:
        _BEFORE.reset(token)
        with signals_wait():
            for other in filter(None, before.values()):
                with suppress(OSError):
                    other.unlink(missing_ok=True)


@contextmanager
def temporary_beside(file: Path) -> Iterator[Path]:
    """Make an empty file to fill, of the same suffix: libraries choose the format by it.

    It is locked while its process lives, so that others recognise one that was left over.
    """
    made: list[tuple[int, str]] = []
    try:
        with signals_wait():
            made.append(tempfile.mkstemp(suffix=file.suffix, prefix=TEMPORARY, dir=file.parent))
        handle, name = made[0]
        with suppress(OSError):
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield Path(name)
    finally:
        with signals_wait():
            for handle, name in made:
                os.close(handle)
                Path(name).unlink(missing_ok=True)


def discard_temporaries(folder: Path) -> None:
    """Remove what killed processes left in a folder and in its subfolders."""
    for pattern in (f"{TEMPORARY}*", f"*/{TEMPORARY}*"):
        for file in folder.glob(pattern):
            with suppress(OSError):
                handle = os.open(file, os.O_RDWR | _PLAIN)
                try:
                    fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    file.unlink()
                finally:
                    os.close(handle)


@contextmanager
def temporary_folder() -> Iterator[Path]:
    """Make an empty folder in the system's temporary directory, removed after its use.

    It is locked while its process lives. The first one that another process makes removes those
    that killed processes left.
    """
    _discard_folders(Path(tempfile.gettempdir()))
    made: list[str] = []
    handles: list[int] = []
    try:
        with signals_wait():
            made.append(tempfile.mkdtemp(prefix=_SCRATCH))
            handles.append(os.open(made[0], _FOLDER))
        with suppress(OSError):
            fcntl.flock(handles[0], fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield Path(made[0])
    finally:
        with signals_wait():
            for name in made:
                shutil.rmtree(name, ignore_errors=True)
            for handle in handles:
                os.close(handle)


@cache
def _discard_folders(place: Path) -> None:
    """Remove temporary folders of this user whose processes are gone."""
    for folder in place.glob(f"{_SCRATCH}*"):
        with suppress(OSError):
            handle = os.open(folder, _FOLDER)
            try:
                state = os.fstat(handle)
                if state.st_uid == os.getuid() and time.time() > state.st_mtime + _FRESH:
                    fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    shutil.rmtree(folder)
            finally:
                os.close(handle)


@contextmanager
def alone(folder: Path | None, patience: float = 0.0) -> Iterator[None]:
    """Lock a folder against other commands; what a killed one left there is removed first.

    The lock ends with the process, however it dies. A folder that was made for nothing is removed
    again; without a folder nothing is done.

    Raises
    ------
    InputError
        When it cannot be written, or another command uses it for longer than ``patience`` [s].
    """
    if folder is None:
        yield
        return
    absent = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        handle = _locked(folder, time.monotonic() + patience)
    except OSError as error:
        raise InputError(f"cannot be written: {error.strerror or error}", file=folder) from None
    try:
        discard_temporaries(folder)
        yield
    finally:
        with suppress(OSError):
            if os.fstat(handle).st_size == 0:
                (folder / MANIFEST).unlink()
        os.close(handle)
        with suppress(OSError):
            for path in absent:
                path.rmdir()


def _locked(folder: Path, end: float) -> int:
    """Make a folder if needed; open and lock its manifest."""
    while True:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except FileExistsError:
            raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR)) from None
        try:
            handle = _open(folder / MANIFEST)
        except FileNotFoundError:  # whoever was there has just removed the folder again
            continue
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            # Whoever had it may have removed it meanwhile, for nothing was written.
            if os.path.lexists(folder / MANIFEST) and os.path.samestat(
                    os.fstat(handle), os.lstat(folder / MANIFEST)):
                return handle
        except BlockingIOError:
            if time.monotonic() > end:
                os.close(handle)
                raise InputError("is in use by another command: wait for its end, or choose "
                                 "another folder", file=folder) from None
            time.sleep(_GLANCE)
        except OSError as error:
            if error.errno in _NO_LOCKS:
                return handle
            os.close(handle)
            raise
        os.close(handle)


def _open(manifest: Path) -> int:
    """Open a manifest to read and write; an InputError where it is not tympan's list."""
    try:
        handle = os.open(manifest, os.O_RDWR | os.O_CREAT | _PLAIN, 0o644)
    except OSError:
        if os.path.lexists(manifest) and not stat.S_ISREG(os.lstat(manifest).st_mode):
            raise _foreign(manifest) from None
        raise
    try:
        _checked(handle, manifest)
    except InputError:
        os.close(handle)
        raise
    return handle


def _lines(manifest: Path) -> frozenset[str]:
    """Read the entries of a manifest; none where there is no manifest."""
    try:
        handle = os.open(manifest, os.O_RDONLY | _PLAIN)
    except FileNotFoundError:
        return frozenset()
    except OSError:
        raise _foreign(manifest) from None
    try:
        return _checked(handle, manifest)
    finally:
        os.close(handle)


def _checked(handle: int, manifest: Path) -> frozenset[str]:
    """Read the lines of a manifest; an InputError if it is not one."""
    state = os.fstat(handle)
    if not stat.S_ISREG(state.st_mode) or state.st_size > _MOST:
        raise _foreign(manifest)
    content = os.pread(handle, state.st_size, 0)
    if b"\0" in content:
        raise _foreign(manifest)
    return frozenset(content.decode(errors="surrogateescape").split("\n"))


def _foreign(manifest: Path) -> InputError:
    return InputError("is not the list that tympan keeps of its results: it must be a text file; "
                      "remove it, or choose another folder", file=manifest)
