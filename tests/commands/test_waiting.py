"""What a terminal shows while a command works that has no steps."""

from __future__ import annotations

import os
import pty
import subprocess
import sys

import pytest

WAIT = ("import time\nfrom tympan.progress import waiting\n"
        "with waiting('limits'):\n    time.sleep({seconds})\nprint('done')")


@pytest.mark.parametrize(("seconds", "shown"), [(0.1, ""), (1.3, "\rlimits [1 s]\r\x1b[K")])
def test_seconds_are_counted_on_a_terminal_from_the_second_second_on(seconds: float, shown: str
                                                                     ) -> None:
    terminal, end = pty.openpty()
    done = subprocess.run([sys.executable, "-c", WAIT.format(seconds=seconds)], stderr=end,
                          stdout=subprocess.PIPE, text=True, check=True)
    os.write(end, b".")  # reading would wait for ever where nothing came
    read = ""
    while not read.endswith("."):
        read += os.read(terminal, 1000).decode()
    os.close(end)
    os.close(terminal)
    assert read == shown + "."
    assert done.stdout == "done\n"


def test_a_log_has_no_seconds() -> None:
    done = subprocess.run([sys.executable, "-c", WAIT.format(seconds=1.2)], capture_output=True,
                          text=True, check=True)
    assert (done.stdout, done.stderr) == ("done\n", "")
