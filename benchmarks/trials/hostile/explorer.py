"""The explorer: what it is started with, what is copied from it, and what comes over its port."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

from benchmarks.trials.hostile.case import Case, Cases, group
from benchmarks.trials.hostile.inputs import GOOD, SPECIMEN, VHB

#: Where a script finds the benchmarks.
_ROOT = {"PYTHONPATH": str(Path(__file__).parents[3])}
#: A name that is a command of its own where it is not quoted.
_NAME = "my film;touch PWNED;$(touch PWNED).toml"

_COPIED = """
from pathlib import Path
from tympan.fem.film.library import load_specimen
from tympan.explore.copied import command_of
from tympan.explore.view import FilmView
(name,) = [file.name for file in Path().glob("my*")]
print(command_of(FilmView(load_specimen(Path(name)), mass=1e-3), name))
"""

_SENT = """
from benchmarks.explore.serving import frame, received, said, serving

def main():
    with serving() as server:
        page = server.page()
        bad = (b"\\0\\1\\r\\n\\r\\n", server.request(Cookie="\\udcff"), server.request("/\\udcff"),
               server.request(Host="a b"), server.request(Content_Length="-1"),
               b"GET / HTTP/1.1\\r\\n\\r\\n", server.request("/" + 9000 * "a"))
        print("malformed", {server.answer(data)[0] for data in bad})
        print("foreign", {server.answer(data)[0] for data in (
            server.request(Host="evil.example"), server.request(Origin="http://evil.example"),
            server.request(token=False))})
        frames = (frame(b"x", kind=2), frame(b""), frame(12 * b"\\xff"), said(1),
                  said("close"), b"\\xff\\xff")
        closed = 0
        for sent in frames:
            with server.websocket(page) as connection:
                connection.sendall(said("reset") + sent)
                end = rb"\\x88[\\x02-\\x7d]\\x03[\\xe8-\\xf7]"
                closed += bool(received(connection, enough=end))
        print("closed", closed, "of", len(frames))
        strangers = [server.connection() for _ in range(200)]
        print("owner", server.answer(server.request("/nobody/x"))[0])
        for connection in strangers:
            connection.close()
        print("troubles", server.troubles)

if __name__ == "__main__":
    main()
"""


def _no_other_file(folder: Path) -> str:
    return "a command ran" if (folder / "PWNED").exists() else ""


@group("explorer")
def explorer() -> Cases:
    if find_spec("aiohttp") is None:
        return
    explore = "explore specimen.toml --no-browser"
    yield Case("port 70000", f"{explore} --port 70000", GOOD, "--port: given 70000")
    yield Case("no such address", f"{explore} --host 203.0.113.1", GOOD,
               "--port.*cannot be listened on", seconds=5.0)
    yield Case("mass nan", f"{explore} --mass 'nan g'", GOOD, "--mass", seconds=5.0)
    yield Case("voltage 1e9 kV", f"{explore} --voltage '1e9 kV'", GOOD, "--voltage", seconds=5.0)
    yield Case("empty folder", "explore . --no-browser", {}, "must hold dataset.toml or specimens",
               seconds=5.0)
    yield Case("no plate", explore, {"specimen.toml": 'name = "a"\n[frame]\nshape = "circle"\n'
                                     'radius = "4 cm"\n[membrane]\nthickness = "1 mm"\n'
                                     f"prestretch = [2, 2]\nrelative_permittivity = 4\n{VHB}"},
               "plate", seconds=5.0)
    yield Case("copied command", "-c 'import subprocess, sys; command = subprocess.check_output(["
               "sys.executable, \"a.py\"], text=True); print(command); subprocess.run(["
               "\"sh\", \"-c\", \"tympan() { printf \\\"<%s>\\\" \\\"$@\\\"; }\\n\" + command])'",
               {_NAME: SPECIMEN, "a.py": _COPIED}, status=0,
               shows=r"<solve><my film;touch PWNED;\$\(touch PWNED\)\.toml>",
               check=_no_other_file, program=())
    yield Case("garbage over its port", "a.py", {"a.py": _SENT}, status=0, program=(),
               environment=_ROOT, shows=r"malformed \{400\}\nforeign \{403\}\nclosed 6 of 6\n"
               r"owner 302\ntroubles \[\]")
