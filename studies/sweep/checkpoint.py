"""Finished tasks on disk: one checked file each, so that whatever was finished stays finished."""

from __future__ import annotations

import fcntl
import hashlib
import json
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from operator import methodcaller
from pathlib import Path

from tympan.geometry.errors import InputError
from tympan.studies.files import write_atomically, write_text
from tympan.studies.sweep.task import Row, SweepTask, TaskResult

#: What a killed sweep may leave: files that were not renamed yet.
_TEMPORARY = (".sweep-*", "tasks/*/.*", "fields/.*")


@dataclass(frozen=True)
class Checkpoint:
    """Finished tasks in the folder of a sweep.

    A task's file is ``tasks/xx/ID.json``, xx the id's first digits: the SHA-256 of all that follows
    the first line, then the id, the time it took and the rows. Files are written under another name
    and renamed.
    """

    folder: Path

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Nobody else works in the folder meanwhile; ends with the process, however it dies."""
        with ExitStack() as stack:
            try:
                self.folder.mkdir(parents=True, exist_ok=True)
                fcntl.flock(stack.enter_context((self.folder / ".lock").open("w")),
                            fcntl.LOCK_EX | fcntl.LOCK_NB)
                for pattern in _TEMPORARY:
                    for temporary in self.folder.glob(pattern):
                        temporary.unlink()
            except BlockingIOError:
                raise InputError("is in use by another sweep", file=self.folder) from None
            except OSError as error:
                raise InputError(f"cannot be written: {error.strerror or error}",
                                 file=self.folder) from None
            yield

    def put(self, task: SweepTask, result: TaskResult) -> None:
        """Keep a result; its fields first, so that a task with a file has them all."""
        for case_id, content in result.fields.items():
            write_atomically(self._vtu(case_id), methodcaller("write_bytes", content))
        body = json.dumps({"task": task.id, "wall_s": result.wall_s,
                           "fields": sorted(result.fields), "rows": result.rows},
                          ensure_ascii=False)
        write_text(self._file(task), f"{_digest(body)}\n{body}\n")

    def get(self, task: SweepTask) -> list[Row] | None:
        """The rows of a finished task; None if its file is missing, damaged or lacks fields."""
        try:
            digest, body = self._file(task).read_text(encoding="utf-8").rstrip("\n").split("\n", 1)
        except FileNotFoundError:
            return None
        except OSError as error:
            raise InputError(f"cannot be read: {error.strerror or error}",
                             file=self._file(task)) from None
        except ValueError:  # also bytes that are no text
            return None
        if digest != _digest(body):
            return None
        content = json.loads(body)
        if content["task"] != task.id or not all(
                self._vtu(case_id).exists() for case_id in content["fields"]):
            return None
        rows: list[Row] = content["rows"]
        return rows

    def _vtu(self, case_id: str) -> Path:
        return self.folder / "fields" / f"{case_id}.vtu"

    def _file(self, task: SweepTask) -> Path:
        return self.folder / "tasks" / task.id[:2] / f"{task.id}.json"


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
