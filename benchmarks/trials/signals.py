"""Commands ended at random moments: by Ctrl-C, by SIGTERM, or killed; nothing is lost or wrong.

    python -m benchmarks.trials.signals [--moments 20] [--seed 0] [--only NAME] [--kill]

Each command runs once to its end; that is what is right. Then it is started again and again, in a
folder that may hold what an earlier try left, and gets a signal at a random moment between its
start and its end, the process alone or its whole group as from a terminal. It must end with status
130 or 143 and one line, or with 0 and the right results; no process of it may live on. Then the
same command has to end by itself, with the right results to the last digit, and without temporary
files. With ``--kill`` the process is killed (-9) instead, in five commands, 50 times in all.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import re
import shlex
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.start_up import REQUIREMENTS

ROOT = Path(__file__).parents[2]
FILM = """
name = "{name}"
[frame]
shape = "{shape}"
{size}
[plate]
shape = "circle"
radius = "1 cm"
[membrane]
thickness = "1 mm"
prestretch = [3, 3]
relative_permittivity = 4.7
material = "vhb-4910"
"""
OVAL = FILM.format(name="oval", shape="ellipse", size='semi_axes = ["6 cm", "45 mm"]')
ROUND = FILM.format(name="round", shape="circle", size='radius = "45 mm"')
VISCOUS = FILM.format(name="viscous", shape="circle", size='radius = "45 mm"').replace(
    'material = "vhb-4910"', '[membrane.material]\nlaw = "neo_hooke"\nmu = "20 kPa"\n'
    '[[membrane.branch]]\nmodulus = "50 kPa"\ntime = "1 s"')
SWEEP = """
specimen = "oval.toml"
mass = "17.9 g"
voltage = ["0 kV", "2 kV"]
[sample]
method = "sobol"
count = 16
seed = 5
[sample.ranges]
"frame.semi_axes.0" = ["5 cm", "7.5 cm"]
"plate.radius" = ["8 mm", "15 mm"]
"""
STUDY = 'name = "s"\nspecimens = ["round.toml"]\nmass = "20 g"\nvoltage = "2 kV"\n'
DATASET = 'name = "data"\n[[specimen]]\n' + re.sub(
    r"^\[", "[specimen.", ROUND.strip(), flags=re.MULTILINE)
STATIC = "specimen,mass_g,voltage_kV,displacement_mm\n" + "".join(
    f"round,{mass},{volts},{mass * (0.05 + 0.003 * volts**2):.3f}\n"
    for mass in (10, 20) for volts in range(5))
COUPONS = "mode,stretch,nominal_stress_kPa\n" + "".join(
    f"{mode},{stretch},{20 * factor * (stretch - stretch**-power):.3f}\n"
    for mode, factor, power in (("uniaxial", 1.0, 2), ("equibiaxial", 1.0, 5))
    for stretch in (1.2, 1.5, 2.0, 2.5, 3.0))
FILES = {"oval.toml": OVAL, "round.toml": ROUND, "viscous.toml": VISCOUS, "SWEEP.toml": SWEEP,
         "STUDY.toml": STUDY, "REQUIREMENTS.toml": REQUIREMENTS,
         "data/dataset.toml": DATASET,
         "data/static.csv": STATIC, "coupon.csv": COUPONS}
#: Each writes into a folder of its own.
COMMANDS = {
    "solve": "solve oval.toml --mass '20 g' --voltage '2 kV'",
    "curve": "curve round.toml --mass '20 g'",
    "tolerance": "tolerance round.toml --mass '17.9 g' --voltage '2 kV'",
    "sense": "sense round.toml --voltage '0 kV, 2 kV' --to '5 mm'",
    "force": "force round.toml --voltage '0 kV, 2 kV' --to '5 mm' --mass '20 g'",
    "path": "path round.toml --mass '20 g' --refine 0.5",
    "modes": "modes round.toml --mass '20 g' --refine 0.5",
    "transient": "transient viscous.toml --mass '20 g' --signal step --high '2 kV' --duration '2 s'"
                 " --refine 0.5",
    "material fit": "material fit coupon.csv --law neo_hooke --law yeoh",
    "sweep": "sweep SWEEP.toml --workers 2 --refine 0.5",
    "study": "study STUDY.toml",
    "diagnose": "diagnose data --workers 2",
    "design": "design REQUIREMENTS.toml --refine 0.5",
    "lumped build": "lumped build round.toml --refine 0.5",
}
#: Commands that are killed.
KILLED = ("study", "sweep", "diagnose", "design", "lumped build")
#: Relative error of numbers in JSON; elsewhere none. Which worker of a diagnosis solves what, and
#: from what it starts, differs from run to run: so do sizes, by 1e-9, where nothing is ended.
ERRORS = {"diagnose": 1e-8}
WORDS = {signal.SIGINT: "interrupted", signal.SIGTERM: "terminated"}

#: How long the processes of a command may live on after it [s].
_AFTERWARDS = 5.0
#: A command counts as one without end [s].
_NO_END = 600.0
#: Entries of results that differ from run to run: times, when it was, and what was there before.
_CLOCK = re.compile(r"(^|_)(wall_s|seconds|finished|solved|kept)$")


@dataclass(frozen=True)
class End:
    """How a command ended."""

    status: int
    said: str
    seconds: float
    orphans: int

    @property
    def fault(self) -> str:
        """In a word what is wrong with an end by a signal; empty if nothing."""
        if self.orphans:
            return f"{self.orphans} processes live on"
        if self.status not in (0, 130, 143):
            return f"status {self.status}"
        lines = [line for line in self.said.splitlines() if not line.endswith(" left")]
        words = WORDS[signal.Signals(self.status - 128)] if self.status else ""
        if self.status and not (len(lines) == 1 and lines[0].startswith(f"tympan: {words}")):
            return f"said {self.said.strip()[-200:]!r}"
        return ""


class Trial:
    """One command in a folder; ``right`` is what its results are."""

    def __init__(self, name: str, folder: Path) -> None:
        self.name, self.folder = name, folder
        for file, text in FILES.items():
            (folder / file).parent.mkdir(parents=True, exist_ok=True)
            (folder / file).write_text(text, encoding="utf-8")
        whole = self.run("right")
        if whole.status:
            raise SystemExit(f"{name}: status {whole.status}: {whole.said}")
        self.seconds, self.right = whole.seconds, self.results("right")

    def run(self, output: str, number: int = 0, moment: float = 0.0, group: bool = False) -> End:
        """Run it, with a signal so long after it has begun to listen [s]."""
        process = subprocess.Popen(
            [sys.executable, "-m", "tympan", *shlex.split(COMMANDS[self.name]), "-o", output],
            cwd=self.folder, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE, text=True, start_new_session=True,
            env=os.environ | {"PYTHONPATH": str(ROOT), "TYMPAN_CACHE": ""})
        began = time.perf_counter()
        if number:
            while not listens(process.pid) and process.poll() is None:
                time.sleep(0.002)
            try:
                process.wait(moment)
            except subprocess.TimeoutExpired:
                (os.killpg if group else os.kill)(process.pid, number)
        try:
            _, said = process.communicate(timeout=_NO_END)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            raise SystemExit(f"{self.name}: no end, {moment} s after its start") from None
        status = process.returncode if process.returncode >= 0 else 128 - process.returncode
        return End(status, said, time.perf_counter() - began, orphans(process.pid))

    def results(self, output: str) -> dict[str, Any]:
        """Numbers and texts of a folder, without what tells the time, and without pictures."""
        return {str(file.relative_to(self.folder / output)): content_of(file)
                for file in sorted((self.folder / output).rglob("*"))
                if file.suffix in (".json", ".csv", ".toml", ".vtu", ".pvd") and file.is_file()
                and not file.name.startswith(".") and "tasks" not in file.parts}

    def fault(self, number: int, moment: float, group: bool, output: str) -> tuple[int, str]:
        """Status after a signal, and in a word what is wrong with it or with the next run."""
        end = self.run(output, number, moment, group)
        fault = end.fault
        if number == signal.SIGKILL:
            fault = f"{end.orphans} processes live on" if end.orphans else ""
        if fault:
            return end.status, fault
        if not (self.folder / output).exists():  # nothing that another run could stumble over
            return end.status, ""
        if end.status:
            if number != signal.SIGKILL and list((self.folder / output).rglob(".tympan-*")):
                return end.status, "temporary files"
            again = self.run(output)
            if again.status:
                return end.status, f"the next run: status {again.status}: {again.said.strip()}"
        if list((self.folder / output).rglob(".tympan-*")):
            return end.status, "temporary files after the next run"
        wrong = differences(self.right, self.results(output), ERRORS.get(self.name, 0.0))
        return end.status, f"other results: {', '.join(wrong)}" if wrong else ""


def content_of(file: Path) -> Any:
    """What a result says, without times of the clock."""
    text = file.read_text(encoding="utf-8")
    return timeless(json.loads(text)) if file.suffix == ".json" else text


def timeless(value: Any) -> Any:
    """A JSON value without its times of the clock."""
    if isinstance(value, dict):
        return {key: timeless(entry) for key, entry in value.items()
                if not _CLOCK.search(str(key))}
    return [timeless(entry) for entry in value] if isinstance(value, list) else value


def differences(right: Mapping[str, Any], other: Mapping[str, Any], error: float) -> list[str]:
    """Files that differ, by more than a relative error of their numbers, or are missing in one."""
    return sorted(file for file in {*right, *other}
                  if not same(right.get(file), other.get(file), error))


def same(value: Any, other: Any, error: float) -> bool:
    """Whether two JSON values are the same but for a relative error of numbers."""
    if isinstance(value, dict) and isinstance(other, dict):
        return value.keys() == other.keys() and all(same(entry, other[key], error)
                                                    for key, entry in value.items())
    if isinstance(value, list) and isinstance(other, list):
        return len(value) == len(other) and all(map(partial(same, error=error), value, other))
    if isinstance(value, float) and isinstance(other, float):
        return math.isclose(value, other, rel_tol=error)
    return bool(value == other)


def listens(process: int) -> bool:
    """Whether a process catches SIGTERM."""
    try:
        status = Path(f"/proc/{process}/status").read_text()
    except OSError:
        return False
    caught = next((line.split()[1] for line in status.splitlines() if line.startswith("SigCgt")),
                  "0")
    return bool(int(caught, 16) >> (signal.SIGTERM - 1) & 1)


def orphans(session: int) -> int:
    """Processes of a session that live on."""
    end = time.monotonic() + _AFTERWARDS
    while count := list(sessions()).count(session):
        if time.monotonic() > end:
            return count
        time.sleep(0.02)
    return 0


def sessions() -> Iterator[int]:
    """The session of every process that is no zombie."""
    for folder in Path("/proc").iterdir():
        if folder.name.isdecimal():
            try:
                state, _, _, session = (folder / "stat").read_text().rpartition(")")[2].split()[:4]
            except (OSError, ValueError):
                continue
            if state != "Z":
                yield int(session)


def tried(name: str, moments: int, seed: int, kill: bool) -> tuple[Counter[int], list[str]]:
    """A command ended at so many moments: how often with which status, and what was wrong."""
    random = np.random.default_rng([seed, *name.encode(), kill])
    statuses, faults = Counter[int](), []
    with tempfile.TemporaryDirectory() as scratch:
        trial = Trial(name, Path(scratch))
        for number in range(moments):
            sent = signal.SIGKILL if kill else (signal.SIGINT, signal.SIGTERM)[number % 2]
            moment = float(random.uniform(0.0, trial.seconds))
            group = not kill and bool(random.random() < 0.5)
            # Half of them begin in an empty folder, the others where the last one ended.
            output = f"out-{number // 2}"
            status, fault = trial.fault(sent, moment, group, output)
            statuses[status] += 1
            if fault:
                faults.append(f"{name}, {signal.Signals(sent).name} after {moment:.3f} s"
                              f"{' to the group' * group}: {fault}")
                print(faults[-1], flush=True)
    return statuses, faults


def main() -> int:
    """Print a line a command; 1 where anything was wrong."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--moments", type=int, default=None, metavar="N",
                        help="of each command (default: 20; 10 with --kill)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", metavar="NAME", help="commands with this word")
    parser.add_argument("--kill", action="store_true", help="kill five commands instead")
    options = parser.parse_args()
    moments = options.moments or (10 if options.kill else 20)
    names = [name for name in (KILLED if options.kill else COMMANDS) if options.only in name]
    total, wrong = 0, 0
    for name in names:
        began = time.perf_counter()
        statuses, faults = tried(name, moments, options.seed, options.kill)
        total, wrong = total + moments, wrong + len(faults)
        print(f"{name:14s} {moments} moments: "
              f"{', '.join(f'{count} x {status}' for status, count in sorted(statuses.items()))}; "
              f"{len(faults)} wrong; {time.perf_counter() - began:.0f} s", flush=True)
    print(f"{len(names)} commands, {total} {'kills' if options.kill else 'signals'}, seed "
          f"{options.seed}: {wrong} lost, wrong or not ended")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
