"""The folder of a command's results: whose files are in it, who works in it, what a kill left.

``.tympan`` lists every result written there as ``sha256sum`` does, digest and name; so a file that
somebody put in a result's place, or changed, is not taken for ours. The list is also what a command
locks while it works in the folder.
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

#: In each folder, digest and name of the files that were written there, one a line.
MANIFEST = ".tympan"
#: What names of files that are not whole yet begin with.
TEMPORARY = ".tympan-"

#: What names of temporary folders begin with; nobody gives such a name to results.
_SCRATCH = f"{TEMPORARY}scratch-"
#: How long a temporary folder may be without a lock, as one that was made just now is [s].
_FRESH = 60.0

#: Most bytes of a manifest: some 100,000 results.
_MOST = 16_000_000
#: How often a folder that is in use is tried again by those who wait [s].
_GLANCE = 0.05
#: What results were before those who write several together: each file that they replaced or
#: removed, and the other name of its content; None where there was none.
_BEFORE: ContextVar[dict[Path, Path | None] | None] = ContextVar("before", default=None)
#: A link is not followed, and a pipe not waited for.
_PLAIN = os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
_FOLDER = os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC
#: File systems without locks are worked on without.
_NO_LOCKS = (errno.ENOLCK, errno.ENOTSUP, errno.ENOSYS, errno.EINVAL)


def digest_of(file: Path) -> str:
    """SHA-256 of a regular file; "" where there is none, or something else."""
    try:
        handle = os.open(file, os.O_RDONLY | _PLAIN)
    except OSError:
        return ""
    with os.fdopen(handle, "rb") as stream:
        if not stat.S_ISREG(os.fstat(handle).st_mode):
            return ""
        return hashlib.file_digest(stream, "sha256").hexdigest()


def is_own(file: Path) -> bool:
    """Whether a file is there as it was written here; False where there is none.

    Raises
    ------
    InputError
        When it is somebody else's, or was changed.
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
    """Give a whole file its name, and list it unless nobody else gives such names.

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
    """Remove a result, if it is there."""
    with signals_wait():
        _keep(file)
        file.unlink(missing_ok=True)


def _keep(file: Path) -> None:
    """Give the content of a result another name before it is replaced, where it may come back."""
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
    """All results that are written into a folder meanwhile, or none.

    A failure leaves the earlier ones and their list. Their content needs no room meanwhile.
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
    """An empty file to fill, of the same suffix: libraries choose the format by it.

    Locked as long as its process lives, so that others know when it is left over.
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
    """Remove what killed processes left in a folder and in those that stand in it."""
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
    """An empty folder in the system's temporary directory, as long as it is used.

    Locked as long as its process lives: the first of another process removes what killed ones left.
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
    """Nobody else works in the folder meanwhile; what a kill left there is removed first.

    Ends with the process, however that dies. A folder that was made for nothing is removed again;
    without one nothing is done.

    Raises
    ------
    InputError
        When it cannot be written, or another command works in it longer than ``patience`` [s].
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
    """The manifest, open and locked, in a folder that is made."""
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
    """Open a list to read and write; an InputError where it is no list of ours."""
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
    """Entries of a manifest; none where there is no manifest."""
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
    """The lines of a manifest; an InputError of what is none."""
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
