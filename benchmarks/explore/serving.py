"""The explorer's server within this process, and raw connections to it."""

from __future__ import annotations

import asyncio
import base64
import json
import logging
import re
import socket
import struct
import threading
import time
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

#: An oval film of the library, as a file would have it.
OVAL = """name = "oval"
frame = { shape = "ellipse", semi_axes = ["6 cm", "45 mm"] }
plate = { shape = "circle", radius = "1 cm" }
membrane = { thickness = "1 mm", prestretch = 2.236, material = "vhb-4910" }
"""


@dataclass
class Serving:
    """A running server, and what went wrong within it."""

    explorer: Any
    loop: asyncio.AbstractEventLoop
    troubles: list[str] = field(default_factory=list)

    @property
    def token(self) -> str:
        """What the owner shows."""
        return str(self.explorer.token)

    @property
    def host(self) -> str:
        """The Host header of a right request."""
        return f"127.0.0.1:{self.explorer.port}"

    def connection(self, timeout: float = 5.0) -> socket.socket:
        """A connection that has said nothing."""
        return socket.create_connection(("127.0.0.1", self.explorer.port), timeout)

    def request(self, path: str = "/", method: str = "GET", token: bool = True,
                **headers: str) -> bytes:
        """A request; ``headers`` with _ for -, empty ones are left out."""
        named = {"Host": self.host, **({"Cookie": self.cookie} if token else {}),
                 **{name.replace("_", "-"): text for name, text in headers.items()}}
        lines = [f"{name}: {text}" for name, text in named.items() if text]
        return "\r\n".join([f"{method} {path} HTTP/1.1", *lines, "", ""]).encode(
            "utf-8", "surrogateescape")

    @property
    def cookie(self) -> str:
        """What the owner's browser sends."""
        return f"tympan-{self.explorer.port}={self.token}"

    def answer(self, data: bytes, timeout: float = 20.0) -> tuple[int, dict[str, str], bytes]:
        """Status, headers and the beginning of the content; status 0 where nothing comes."""
        with self.connection(timeout) as connection:
            connection.sendall(data)
            return parsed(received(connection))

    def page(self) -> str:
        """The name of a new page."""
        return self.answer(self.request(), 60.0)[1]["location"].split("/")[1]

    def websocket(self, page: str, timeout: float = 5.0) -> socket.socket:
        """A connection of a page that has shaken hands, once earlier ones are gone."""
        for _ in range(50):
            connection = self.connection(20.0)
            connection.sendall(self.request(f"/{page}/ws", **UPGRADE,
                                            Origin=f"http://{self.host}"))
            status, _, _ = parsed(received(connection))
            if status == 101:
                connection.settimeout(timeout)
                return connection
            connection.close()
            assert status == 503, status
            time.sleep(0.1)
        raise AssertionError("the page's websockets stay open")


UPGRADE = {"Connection": "Upgrade", "Upgrade": "websocket", "Sec_WebSocket_Version": "13",
           "Sec_WebSocket_Key": base64.b64encode(bytes(16)).decode()}


#: Length of whatever a pattern waits for, at most.
_SHORT = 1000


def received(connection: socket.socket, enough: bytes = rb"\r\n\r\n") -> bytes:
    """What comes until a short pattern is there, the end, or the connection's timeout."""
    # Bytes that grow in place: an answer of megabytes is not copied with each part of it.
    data, pattern = bytearray(), re.compile(enough, re.DOTALL)
    searched = 0
    try:
        while not pattern.search(data, searched):
            # Nor is it searched again.
            searched = max(0, len(data) - _SHORT)
            part = connection.recv(65536)
            if not part:
                break
            data += part
    except (TimeoutError, ConnectionError):
        pass
    return bytes(data)


def parsed(data: bytes) -> tuple[int, dict[str, str], bytes]:
    """Status, headers by their names in small letters, and content."""
    head, _, content = data.partition(b"\r\n\r\n")
    first, *lines = head.decode("latin-1").split("\r\n")
    pairs = (line.split(": ", 1) for line in lines if ": " in line)
    words = first.split()
    return (int(words[1]) if len(words) > 1 else 0,
            {name.lower(): text for name, text in pairs}, content)


def frame(content: bytes, kind: int = 1, mask: bytes = b"\x01\x02\x03\x04") -> bytes:
    """A websocket frame as a browser sends it (RFC 6455, section 5.2)."""
    size = (bytes([128 + len(content)]) if len(content) < 126 else
            bytes([128 + 126]) + struct.pack(">H", len(content)) if len(content) < 65536 else
            bytes([128 + 127]) + struct.pack(">Q", len(content)))
    masked = bytes(byte ^ mask[place % 4] for place, byte in enumerate(content))
    return bytes([128 + kind]) + size + mask + masked


def said(*message: Any) -> bytes:
    """The frame of what a page says."""
    return frame(json.dumps(message).encode())


#: What a page says: sliders, fields, buttons; nothing that writes a file.
CALLS = tuple(json.dumps(message) for message in (
    ["typed", "voltage", "2.5 kV"], ["slid", "stiffness", "1.02"], ["slid", "mass", "17.5"],
    ["typed", "plate.offset.0", "1"], ["choose", 0], ["reset"]))


class _Kept(logging.Handler):
    """What libraries would print."""

    def __init__(self, troubles: list[str]) -> None:
        super().__init__(logging.WARNING)
        self.troubles = troubles

    def emit(self, record: logging.LogRecord) -> None:
        self.troubles.append(f"{record.name}: {record.getMessage()}")


@contextmanager
def serving() -> Iterator[Serving]:
    """The explorer of an oval film in a thread; what it reports or logs is kept as a trouble."""
    from tympan.base.toml_reader import Table
    from tympan.explore.server import Explorer
    from tympan.explore.subject import Subject
    from tympan.fem.film.library import load_specimen
    from tympan.fem.rig import Rig

    specimen = load_specimen(Table("oval.toml", tomllib.loads(OVAL)))
    subject = Subject("oval", (specimen,), Rig())
    loop, begun = asyncio.new_event_loop(), threading.Event()
    troubles: list[str] = []
    explorer = Explorer(subject, subject.view(0, 17.9e-3), report=troubles.append)
    loop.set_exception_handler(lambda _, context: troubles.append(str(context)))

    def run() -> None:
        asyncio.set_event_loop(loop)
        loop.run_until_complete(explorer.begin())
        begun.set()
        loop.run_forever()

    thread, kept = threading.Thread(target=run, daemon=True), _Kept(troubles)
    logging.getLogger().addHandler(kept)
    thread.start()
    try:
        assert begun.wait(60)
        yield Serving(explorer, loop, troubles)
    finally:
        asyncio.run_coroutine_threadsafe(explorer.end(), loop).result(30)
        loop.call_soon_threadsafe(loop.stop)
        thread.join(30)
        loop.close()
        logging.getLogger().removeHandler(kept)
