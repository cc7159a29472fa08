"""The explorer's server among strangers: what it answers, and that the owner always gets in."""

from __future__ import annotations

import re
import socket
import time
from collections.abc import Iterator

import pytest

from benchmarks.explore.serving import (
    CALLS,
    UPGRADE,
    Serving,
    frame,
    parsed,
    received,
    said,
    serving,
)

pytest.importorskip("aiohttp", reason="aiohttp is not installed")

from tympan.explore import door  # it imports what may lack
from tympan.explore.server import MOST_SOCKETS

SAFE = {"cache-control": "no-store", "x-content-type-options": "nosniff",
        "x-frame-options": "DENY", "referrer-policy": "no-referrer"}


@pytest.fixture(scope="module")
def server() -> Iterator[Serving]:
    """A server; nothing goes wrong in it, whatever is sent."""
    with pytest.MonkeyPatch.context() as patch, serving() as running:
        patch.setattr("tympan.explore.server._KEPT", 600.0)
        yield running
        assert running.troubles == []


@pytest.fixture(scope="module")
def page(server: Serving) -> str:
    """The name of a page, which stays without a browser."""
    return server.page()


def is_safe(headers: dict[str, str]) -> bool:
    """Whether an answer has all that every answer has."""
    policy = headers.get("content-security-policy", "")
    return ({name: headers.get(name) for name in SAFE} == SAFE
            and "frame-ancestors 'none'" in policy and "default-src 'none'" in policy
            and "unsafe" not in policy)


def test_every_answer_is_safe(server: Serving, page: str) -> None:
    for status, data in (
            (302, server.request()), (200, server.request(f"/{page}/index.html")),
            (200, server.request(f"/{page}/viewer.js")),
            (404, server.request(f"/{page}/nothing")), (302, server.request("/nobody/index.html")),
            (403, server.request(token=False)), (405, server.request(method="POST")),
            (101, server.request(f"/{page}/ws", **UPGRADE)), (400, b"\x00\x01\r\n\r\n")):
        got, headers, _ = server.answer(data)
        assert got == status, data
        assert is_safe(headers), (data, headers)


@pytest.mark.parametrize("data", [
    "GET / HTTP/1.1\r\n\r\n", "GET / HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n",
    "GET / HTTP/1.1\r\nHost: {host}\r\nCookie: tympan-1=\udcff\udcfe\r\n\r\n",
    "GET / HTTP/1.1\r\nHost: {host}\r\nCookie: {cookie}\r\nX: a\udcff\r\n\r\n",
    "GET /\udcff\udcfe HTTP/1.1\r\nHost: {host}\r\nCookie: {cookie}\r\n\r\n",
    "GET /a%00b HTTP/1.1\r\nHost: {host}\r\nCookie: {cookie}\r\n\r\n",
    "GET /%0d%0aSet-Cookie:x HTTP/1.1\r\nHost: {host}\r\nCookie: {cookie}\r\n\r\n",
    "GET http://[::bad/ HTTP/1.1\r\nHost: {host}\r\n\r\n", "GET / HTTP/9.9\r\nHost: {host}\r\n\r\n",
    "GET / HTTP/1.1\r\nHost: {host}\r\nContent-Length: -1\r\n\r\n",
    "GET / HTTP/1.1\r\nHost: {host}\r\nTransfer-Encoding: chunked\r\nContent-Length: 3\r\n\r\n",
    "GET / HTTP/1.1\r\nHost: {host}\r\n broken\r\n\r\n", "GET / HTTP/1.1\r\nHo st: {host}\r\n\r\n",
    "GET / HTTP/1.1\r\nHost: {host}/@x\r\n\r\n", "{long}", "\x16\x03\x01\x02\x00\x01\r\n\r\n"])
def test_what_is_malformed_is_a_bad_request(server: Serving, data: str) -> None:
    filled = data.replace("{host}", server.host).replace("{cookie}", server.cookie).replace(
        "{long}", f"GET /{'a' * 20_000} HTTP/1.1\r\nHost: {server.host}\r\n\r\n")
    status, headers, content = server.answer(filled.encode("utf-8", "surrogateescape"))
    assert status == 400
    assert is_safe(headers)
    assert b"Traceback" not in content
    assert content.count(b"\n") == 1


@pytest.mark.parametrize("key", ["1 µm==", "no key", "AAAA"])
def test_a_bad_key_of_a_websocket_is_a_bad_request(server: Serving, page: str, key: str) -> None:
    asked = server.request(f"/{page}/ws", **{**UPGRADE, "Sec_WebSocket_Key": key})
    assert server.answer(asked)[0] == 400


def test_a_body_in_bad_chunks_ends_the_connection(server: Serving) -> None:
    head = server.request("/x", Transfer_Encoding="chunked")
    with server.connection() as connection:
        connection.sendall(head + b"ZZ\r\nno chunk\r\n")
        assert parsed(received(connection))[0] in (302, 400)
        assert connection.recv(1) == b""


@pytest.mark.parametrize(("host", "status"), [
    ("127.0.0.1:1", 302), ("localhost:9000", 302), ("[::1]:80", 302), ("LOCALHOST", 302),
    ("evil.example", 403), ("evil.example:80", 403), ("127.0.0.1.evil.example", 403),
    ("localhost.evil.example", 403), ("localhost:x", 400), ("", 400), ("a b", 400)])
def test_a_foreign_name_is_refused(server: Serving, host: str, status: int) -> None:
    """Even with the token: a foreign page whose name was led here (DNS rebinding) has no more."""
    data = server.request("/nobody/index.html", Host=host or " ")
    assert server.answer(data)[0] == status


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "http://127.0.0.1:1", "x", "é"])
def test_a_foreign_page_opens_no_websocket(server: Serving, page: str, origin: str) -> None:
    assert server.answer(server.request(f"/{page}/ws", **UPGRADE, Origin=origin))[0] == 403
    right = server.request(f"/{page}/ws", **UPGRADE, Origin=f"http://{server.host}")
    assert server.answer(right)[0] == 101


def until_closed(connection: socket.socket) -> float:
    """Seconds until the other side ends a connection."""
    began = time.monotonic()
    received(connection, enough=rb"\Znever")
    return time.monotonic() - began


def test_strangers_end_after_seconds_whatever_they_do(
        server: Serving, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(door, "PATIENCE", 1.0)
    idle, slow, many = (server.connection(10.0) for _ in range(3))
    slow.sendall(b"GET / HTTP/1.1\r\n")
    many.sendall(50 * server.request(token=False))  # and reads no answer
    began = time.monotonic()
    slow.settimeout(0.05)
    closed = False
    while not closed and time.monotonic() < began + 10:
        try:
            slow.sendall(b"X: y\r\n")
            closed = slow.recv(1) == b""
        except TimeoutError:
            pass
        except ConnectionError:
            closed = True
    assert closed
    assert time.monotonic() - began < 8
    assert until_closed(idle) < 8
    assert until_closed(many) < 8
    assert parsed(b"HTTP/1.1 403 Forbidden\r\n\r\n")[0] == 403
    for connection in (idle, slow, many):
        connection.close()


def test_the_owner_gets_in_among_many_strangers(server: Serving) -> None:
    strangers = [server.connection() for _ in range(3 * door.STRANGERS)]
    try:
        for _ in range(20):
            assert server.answer(server.request("/nobody/index.html"))[0] == 302
        open_now = sum(is_open(connection) for connection in strangers)
        assert open_now <= door.STRANGERS
    finally:
        for connection in strangers:
            connection.close()


def is_open(connection: socket.socket) -> bool:
    """Whether the other side has not ended a connection that sends nothing."""
    connection.setblocking(False)
    try:
        return connection.recv(1) != b""
    except BlockingIOError:
        return True
    except ConnectionError:
        return False


def test_a_stranger_gets_one_answer(server: Serving) -> None:
    with server.connection() as connection:
        connection.sendall(2 * server.request(token=False))
        assert received(connection, enough=rb"\Znever").count(b"HTTP/1.1") == 1


def closing(server: Serving, page: str, *frames: bytes) -> int:
    """The code with which a websocket is closed after some frames; 0 where it stays open."""
    end = rb"\x88[\x02-\x7d](\x03[\xe8-\xf7])"
    with server.websocket(page, 10.0) as connection:
        connection.sendall(b"".join(frames))
        close = re.search(end, received(connection, enough=end), re.DOTALL)
    return int.from_bytes(close[1], "big") if close else 0


@pytest.mark.parametrize("sent", [
    frame(b"text", kind=2), frame(b""), frame(b"text"), frame(b"\xff" * 40), frame(b"[" * 5000),
    frame(b"{}"), frame(b"[]"), frame(b"1"), said(["slid"]), said(None), said("nothing"),
    said("close"), said("_begin", 0), said("typed", "voltage"), said("slid", "voltage", 3),
    said("slid", "voltage", "3", "4"), said("choose", "0"), said("choose", 0.0),
    said("choose", True), said("choose", float("nan")), said("save", "file"),
    said("typed", "voltage", "9" * 70_000),
    b"\xff\xff\xff\xff", frame(b"x", kind=3), frame(200 * b"x", kind=9), b"\x82\x05hello",
    b"\x81\xff" + b"\x7f" + 7 * b"\xff" + b"mask"])
def test_what_the_page_never_says_ends_its_websocket(server: Serving, page: str, sent: bytes
                                                     ) -> None:
    """And no other one."""
    assert closing(server, page, said("reset"), sent) in (1002, 1003, 1007, 1008, 1009)
    with server.websocket(page) as other:
        other.sendall(said("typed", "voltage", "no number"))
        assert b"must be a voltage" in received(other, enough=b"must be a voltage")


def test_what_the_page_says_is_answered(server: Serving, page: str) -> None:
    assert len(CALLS) == 6
    with server.websocket(page, 30.0) as connection:
        for text in CALLS:
            connection.sendall(frame(text.encode()))
        connection.sendall(said("typed", "voltage", "no number"))
        data = received(connection, enough=b"must be a voltage")
    assert b"must be a voltage" in data


def test_a_control_that_is_no_more_and_a_specimen_that_is_none_change_nothing(
        server: Serving, page: str) -> None:
    with server.websocket(page, 30.0) as connection:
        for message in (("reset",), ("typed", "frame.vertices.9", "3"), ("slid", "", "x"),
                        ("choose", 7), ("choose", -1), ("typed", "voltage", "9" * 5000)):
            connection.sendall(said(*message))
        data = received(connection, enough=b"must be from 0 to")
    assert b"must be from 0 to" in data
    assert b"vertices" not in data


def test_a_page_has_few_websockets(server: Serving) -> None:
    name = server.page()
    several = [server.websocket(name) for _ in range(MOST_SOCKETS)]
    assert server.answer(server.request(f"/{name}/ws", **UPGRADE))[0] == 503
    for connection in several:
        connection.close()
