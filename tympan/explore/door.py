"""Connections of the explorer's server: few strangers, for a short time, and safe answers.

A stranger is a connection that has not shown the token. The newest stranger always gets in and the
oldest is closed, so that nobody can keep the owner out by holding connections.
"""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Awaitable, Callable
from ipaddress import ip_address
from typing import Any

from aiohttp import web

#: Seconds until a stranger's connection is closed, whatever it does.
PATIENCE = 5.0
#: Seconds until an idle connection of the owner is closed; browsers open another when needed.
_IDLE = 15.0
#: Most strangers at once. The owner's browser shows its token within milliseconds.
STRANGERS = 64
#: Most connections of the owner at once: eight pages of six connections and a websocket, and more.
_MOST_OWN = 128
#: Most bytes of a request's line and of a header; browsers send a tenth of it.
_LINE = 4096
#: Most headers of a request; browsers send fifteen.
_HEADERS = 64

#: Headers of every answer in addition to its policy: store nothing, guess no type, send nobody the
#: address, which holds the token, and be part of no other site's page.
_SAFE = {"Cache-Control": "no-store", "X-Content-Type-Options": "nosniff",
         "X-Frame-Options": "DENY", "Referrer-Policy": "no-referrer",
         "Cross-Origin-Opener-Policy": "same-origin",
         "Cross-Origin-Resource-Policy": "same-origin"}

#: Sources that a page may load and run: only this server's files.
_POLICY = {"default-src": "'none'", "script-src": "'self'", "style-src": "'self'",
           "img-src": "data:", "connect-src": "'self'", "base-uri": "'none'",
           "form-action": "'none'", "frame-ancestors": "'none'"}

Answering = Callable[[web.BaseRequest], Awaitable[web.StreamResponse]]


def policy(host: str = "") -> str:
    """Write the Content-Security-Policy of an answer; ``host`` serves the page's websocket.

    Browsers differ in whether 'self' covers websockets.
    """
    extra = {"connect-src": f" ws://{host} wss://{host}"} if host else {}
    return "; ".join(f"{name} {sources}{extra.get(name, '')}"
                     for name, sources in _POLICY.items())


class Door(web.Server):
    """The connections of a server, each a stranger's until :meth:`let_in`.

    ``report`` gets a line for each fault inside the server.
    """

    def __init__(self, answer: Answering, report: Callable[[str], object]) -> None:
        super().__init__(answer, keepalive_timeout=_IDLE, lingering_time=1.0, access_log=None,
                         max_line_size=_LINE, max_field_size=_LINE, max_headers=_HEADERS)
        self.report = report
        self._strangers: dict[web.RequestHandler, asyncio.TimerHandle] = {}
        self._own: dict[web.RequestHandler, asyncio.Transport] = {}

    def __call__(self) -> web.RequestHandler:
        return _Connection(self, loop=asyncio.get_running_loop(), **self._kwargs)

    def connection_made(self, handler: web.RequestHandler, transport: asyncio.Transport) -> None:
        super().connection_made(handler, transport)
        loop = asyncio.get_running_loop()
        self._strangers[handler] = loop.call_later(PATIENCE, transport.abort)
        if len(self._strangers) > STRANGERS:
            oldest = next(iter(self._strangers))
            self._forget(oldest)
            if oldest.transport is not None:
                oldest.transport.abort()

    def connection_lost(self, handler: web.RequestHandler,
                        exc: BaseException | None = None) -> None:
        super().connection_lost(handler, exc)
        self._forget(handler)
        self._own.pop(handler, None)

    def let_in(self, request: web.BaseRequest) -> None:
        """Mark the connection of a request as the owner's.

        Raises
        ------
        aiohttp.web.HTTPServiceUnavailable
            When the owner has too many.
        """
        handler = request.protocol
        if handler in self._own:
            return
        if len(self._own) >= _MOST_OWN:
            raise web.HTTPServiceUnavailable(text="too many connections are open\n")
        self._forget(handler)
        if handler.transport is not None:
            self._own[handler] = handler.transport

    def is_own(self, handler: web.RequestHandler) -> bool:
        """Check whether a connection has shown the token."""
        return handler in self._own

    def _forget(self, handler: web.RequestHandler) -> None:
        timer = self._strangers.pop(handler, None)
        if timer is not None:
            timer.cancel()


class _Connection(web.RequestHandler):
    """A connection with safe answers, and at most one line for a fault."""

    def __init__(self, door: Door, **arguments: Any) -> None:
        super().__init__(door, **arguments)
        self._door = door

    async def finish_response(self, request: web.BaseRequest, resp: web.StreamResponse,
                              start_time: float | None) -> tuple[web.StreamResponse, bool]:
        if not resp.prepared:
            safe(resp, request.headers.get("Host", ""))
            if not self._door.is_own(self):
                resp.force_close()
        return await super().finish_response(request, resp, start_time)

    def handle_error(self, request: web.BaseRequest, status: int = 500,
                     exc: BaseException | None = None, message: str | None = None
                     ) -> web.StreamResponse:
        if status >= 500 and exc is not None:
            self.log_exception("answering", exc_info=exc)
        if request.writer.output_size > 0:
            raise ConnectionError("a part of another answer is sent already")
        words = ("this is no request of HTTP" if status == 400 else
                 "the server made a mistake; the terminal names it")
        answer = web.Response(status=status, text=f"{words}\n")
        answer.force_close()
        return answer

    def log_exception(self, *args: Any, **kw: Any) -> None:
        """Report a fault of the server itself, but not of the other side."""
        error = kw.get("exc_info")
        if isinstance(error, Exception) and not isinstance(error, _OF_OTHERS):
            self._door.report(f"the explorer's server: {type(error).__name__}: {error}")


#: Errors from data that arrive, or fail to arrive, over a connection.
_OF_OTHERS = (OSError, web.RequestPayloadError, web.PayloadAccessError, asyncio.TimeoutError)


def safe(answer: web.StreamResponse, host: str) -> None:
    """Add the headers of every answer."""
    answer.headers.update(_SAFE)
    named = host if _host_name(host) is not None else ""
    answer.headers["Content-Security-Policy"] = policy(named)


def check(request: web.BaseRequest, host: str) -> None:
    """Refuse malformed requests, and requests under a foreign name or by a foreign page.

    A foreign name that leads to this machine (DNS rebinding) would make a foreign page one of this
    server's. Numeric addresses cannot be rebound; ``host`` is the address listened on.

    Raises
    ------
    aiohttp.web.HTTPBadRequest, HTTPForbidden, HTTPMethodNotAllowed
        With a line of text.
    """
    if any(_garbled(text) for pair in request.raw_headers for text in pair):
        raise web.HTTPBadRequest(text="a header is no text\n")
    if _garbled(request.path.encode("utf-8", "surrogateescape")):
        raise web.HTTPBadRequest(text="the path is no text\n")
    names = request.headers.getall("Host", [])
    name = _host_name(names[0]) if len(names) == 1 else None
    if name is None:
        raise web.HTTPBadRequest(text="there must be one header Host\n")
    if not _is_here(name, host):
        raise web.HTTPForbidden(text="asked for under a name that is not this machine's: open the "
                                     "address that tympan printed\n")
    origins = request.headers.getall("Origin", [])
    if origins and origins not in ([f"http://{names[0]}"], [f"https://{names[0]}"]):
        raise web.HTTPForbidden(text="asked by a page from elsewhere\n")
    if not request.headers.get("Sec-WebSocket-Key", "").isascii():
        raise web.HTTPBadRequest(text="the websocket's key is not ASCII\n")
    if request.method != "GET":
        raise web.HTTPMethodNotAllowed(request.method, ["GET"], text="only GET is answered\n")


def _garbled(text: bytes) -> bool:
    """Check for bytes that are not UTF-8, or are control characters."""
    try:
        decoded = text.decode("utf-8")
    except UnicodeDecodeError:
        return True
    return any(ord(character) < 32 or ord(character) == 127 for character in decoded
               if character != "\t")


def _host_name(text: str) -> str | None:
    """Read the name in a Host header, without its port; None if it is no name."""
    name, colon, port = text.rpartition(":")
    if not colon or text.endswith("]"):
        name, port = text, "0"
    if not port.isascii() or not port.isdecimal():
        return None
    bare = name.removeprefix("[").removesuffix("]")
    allowed = set("abcdefghijklmnopqrstuvwxyz0123456789.-:%_")
    return bare.lower() if bare and set(bare.lower()) <= allowed else None


def _is_here(name: str, host: str) -> bool:
    try:
        return bool(ip_address(name))
    except ValueError:
        machine = socket.gethostname().lower()
        return name.rstrip(".") in ("localhost", host.lower(), machine, f"{machine}.local")
