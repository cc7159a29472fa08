"""What comes over a connection to the explorer: requests, websocket frames, messages."""

from __future__ import annotations

import atexit
from contextlib import ExitStack, suppress
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from hypothesis import strategies as st

from benchmarks.explore.serving import (
    CALLS,
    UPGRADE,
    Serving,
    frame,
    parsed,
    received,
    serving,
)
from benchmarks.trials.fuzz.kind import Kind, changed_bytes, changed_text, register

#: Stand for the server's port and token, which differ from run to run.
_HOST, _COOKIE, _PAGE = b"HOST", b"COOKIE", b"PAGE"
#: How long an answer is waited for that may never come [s].
_WAIT = 0.1
#: Statuses of refusals and answers; a mistake of the server's is 500.
_STATUSES = {0, 101, 200, 206, 302, 304, 400, 403, 404, 405, 408, 411, 413, 416, 417, 421, 426, 431,
             501, 503, 505}
_REQUESTS = (
    b"GET / HTTP/1.1\r\nHost: HOST\r\n\r\n",
    b"GET /PAGE/index.html HTTP/1.1\r\nHost: HOST\r\n"
    b"Cookie: COOKIE\r\nAccept: text/html\r\nAccept-Encoding: gzip\r\nConnection: close\r\n\r\n",
    b"GET /PAGE/viewer.js HTTP/1.1\r\nHost: HOST\r\nCookie: a=b; COOKIE\r\nRange: bytes=0-9\r\n"
    b"If-Modified-Since: Thu, 01 Jan 1970 00:00:00 GMT\r\nIf-None-Match: \"x\"\r\n\r\n",
    b"POST /PAGE/ws HTTP/1.1\r\nHost: HOST\r\nCookie: COOKIE\r\nContent-Type: text/plain\r\n"
    b"Transfer-Encoding: chunked\r\n\r\n3\r\nabc\r\n0\r\n\r\n",
    b"GET /PAGE/ws HTTP/1.1\r\nHost: HOST\r\nCookie: COOKIE\r\nOrigin: http://HOST\r\n" + b"".join(
        f"{name.replace('_', '-')}: {text}\r\n".encode() for name, text in UPGRADE.items())
    + b"Sec-WebSocket-Extensions: permessage-deflate; client_max_window_bits=15\r\n\r\n",
    2 * b"GET /PAGE/page.css HTTP/1.1\r\nHost: HOST\r\nCookie: COOKIE\r\n\r\n")


def _server() -> tuple[Serving, str]:
    """The server and its page; what other inputs of this process logged is no trouble of it."""
    running, page = _begun()
    running.troubles.clear()
    return running, page


@cache
def _begun() -> tuple[Serving, str]:
    """A server that lasts as long as this process, and a page of it."""
    from tympan.explore import server

    server._KEPT = 1e6
    stack = ExitStack()
    atexit.register(stack.close)
    running = stack.enter_context(serving())
    return running, running.page()


def _nothing_wrong(running: Serving) -> None:
    assert not running.troubles, running.troubles
    # The owner is answered, whatever came before.
    assert running.answer(running.request("/nobody/index.html"))[0] == 302


def _request(folder: Path) -> None:
    running, page = _server()
    data = (folder / "request").read_bytes()
    for name, value in ((_HOST, running.host), (_COOKIE, running.cookie), (_PAGE, page)):
        data = data.replace(name, value.encode())
    with running.connection(_WAIT) as connection:
        try:
            connection.sendall(data)
            status, headers, _ = parsed(received(connection))
        except OSError:  # the other side has ended it
            status, headers = 0, {}
    assert status in _STATUSES, status
    assert not status or headers.get("cache-control") == "no-store", headers
    _nothing_wrong(running)


def _frames(folder: Path) -> None:
    _talk((folder / "frames").read_bytes())


def _messages(folder: Path) -> None:
    """Each line is a message."""
    _talk(b"".join(map(frame, (folder / "messages").read_bytes().splitlines())))


def _talk(data: bytes) -> None:
    running, page = _server()
    # The other side may have ended it.
    with running.websocket(page, _WAIT) as connection, suppress(OSError):
        connection.sendall(data)
        received(connection, enough=rb"\Znever")
    _nothing_wrong(running)


def _changed(draw: st.DrawFn, content: bytes) -> bytes:
    return draw(st.sampled_from((changed_text, changed_bytes)))(draw, content)


if find_spec("aiohttp") is not None:
    register("explorer request", Kind("request", _REQUESTS, _request, change=_changed))
    register("explorer frames", Kind("frames", (
        *(frame(text.encode()) for text in CALLS),
        frame(b"ping", kind=9) + frame(b"\x03\xe8bye", kind=8)), _frames, change=changed_bytes))
    register("explorer messages", Kind(
        "messages", tuple(f"{CALLS[0]}\n{text}".encode() for text in CALLS), _messages))
