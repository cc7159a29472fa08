"""The server of the pages: one port, a token, a page for each browser."""

from __future__ import annotations

import asyncio
import hmac
import logging
import secrets
from collections.abc import Callable
from dataclasses import dataclass, field

from aiohttp import web

from tympan.explore.door import Door, check, safe
from tympan.explore.latest import prepared
from tympan.explore.page import Page
from tympan.explore.subject import Subject
from tympan.explore.talk import talk
from tympan.explore.view import FilmView
from tympan.reports.template import text_of
from tympan.studies.tolerance.given import Tolerances

#: Time for which a page is kept for a browser that went away [s].
_KEPT = 10.0
#: Most pages at once; each has two processes.
_MOST = 8
#: Longest time for a connection to end [s].
_GOODBYE = 1.0
#: Most websockets of one page; a browser has one, and two while it reconnects.
MOST_SOCKETS = 4
#: Most bytes of a message. The page's longest are typed numbers, about 100 bytes.
_MOST_BYTES = 65_536
#: Seconds between signs of life.
_HEART_BEAT = 30.0

#: Files of the page by the names that it requests, with their types.
_FILES = {"index.html": ("explore/page.html", "text/html"),
          "page.css": ("explore/page.css", "text/css"),
          "page.js": ("explore/page.js", "text/javascript"),
          "viewer.js": ("reports/viewer/viewer.js", "text/javascript")}


@dataclass
class _Served:
    """A page with the websockets of the browsers that show it."""

    page: Page
    sockets: set[web.WebSocketResponse] = field(default_factory=set)


@dataclass
class Explorer:
    """All pages of a subject.

    ``host`` and ``port`` are the address listened on, port 0 for any free one; requests without the
    ``token`` are refused. ``report`` gets a line for each fault of the server itself. With
    ``tolerances`` pages show the scatter of films.
    """

    subject: Subject
    start: FilmView
    host: str = "127.0.0.1"
    port: int = 0
    token: str = field(default_factory=lambda: secrets.token_urlsafe(16))
    report: Callable[[str], object] = print
    tolerances: Tolerances | None = None
    pages: dict[str, _Served] = field(default_factory=dict)
    _door: Door | None = None
    _runner: web.ServerRunner | None = None
    _dropping: set[asyncio.Task[None]] = field(default_factory=set)

    @property
    def address(self) -> str:
        """Address that a browser opens."""
        host = {"0.0.0.0": "127.0.0.1", "::": "[::1]"}.get(self.host, self.host)
        return f"http://{host}:{self.port}/?token={self.token}"

    async def begin(self) -> None:
        """Start listening."""
        prepared()
        # aiohttp prints data of others, with tracebacks; the server reports its own faults.
        logging.getLogger("aiohttp").addHandler(logging.NullHandler())
        logging.getLogger("aiohttp").propagate = False
        self._door = Door(self._answer, self.report)
        self._runner = web.ServerRunner(self._door, shutdown_timeout=_GOODBYE)
        await self._runner.setup()
        await web.TCPSite(self._runner, self.host, self.port).start()
        self.port = self._runner.addresses[0][1]

    async def end(self) -> None:
        """Close all pages and stop listening."""
        for name in list(self.pages):
            await self._drop(name)
        if self._runner is not None:
            await self._runner.cleanup()

    async def _answer(self, request: web.BaseRequest) -> web.StreamResponse:
        """Answer a request with the token, in the address or in a cookie."""
        check(request, self.host)
        given = request.query.get("token") or request.cookies.get(self._cookie, "")
        if not hmac.compare_digest(given.encode("utf-8", "replace"), self.token.encode()):
            raise web.HTTPForbidden(text="the address needs the token that tympan printed\n")
        assert self._door is not None
        self._door.let_in(request)
        name, _, path = request.path.removeprefix("/").partition("/")
        if not name:
            return self._new(request)
        if path == "ws":
            return await self._connect(request, name)
        return self._asset(name, path)

    @property
    def _cookie(self) -> str:
        return f"tympan-{self.port}"

    def _new(self, request: web.BaseRequest) -> web.StreamResponse:
        if len(self.pages) >= _MOST:
            raise web.HTTPServiceUnavailable(text=f"{_MOST} pages are open: close one\n")
        name = secrets.token_hex(4)
        self.pages[name] = _Served(Page(self.subject, self.start, self.tolerances))
        response = web.Response(status=302, headers={"Location": f"/{name}/index.html"})
        response.set_cookie(self._cookie, self.token, httponly=True, samesite="Strict")
        self._drop_later(name)
        return response

    async def _connect(self, request: web.BaseRequest, name: str) -> web.StreamResponse:
        if name not in self.pages:
            raise web.HTTPNotFound(text="this page was closed: open the address anew\n")
        served = self.pages[name]
        if len(served.sockets) >= MOST_SOCKETS:
            raise web.HTTPServiceUnavailable(text="this page is open too often\n")
        socket = web.WebSocketResponse(timeout=_GOODBYE, max_msg_size=_MOST_BYTES,
                                       heartbeat=_HEART_BEAT)
        served.sockets.add(socket)
        try:
            safe(socket, request.headers["Host"])
            await socket.prepare(request)
            await talk(served.page, socket)
        finally:
            served.sockets.discard(socket)
            self._drop_later(name)
        return socket

    def _asset(self, name: str, path: str) -> web.StreamResponse:
        if name not in self.pages:
            raise web.HTTPFound("/")
        if path not in _FILES:
            raise web.HTTPNotFound(text="there is no such file\n")
        file, kind = _FILES[path]
        return web.Response(text=text_of(file), content_type=kind)

    def _drop_later(self, name: str) -> None:
        async def drop() -> None:
            await asyncio.sleep(_KEPT)
            if name in self.pages and not self.pages[name].sockets:
                await self._drop(name)

        task = asyncio.get_running_loop().create_task(drop())
        self._dropping.add(task)
        task.add_done_callback(self._dropping.discard)

    async def _drop(self, name: str) -> None:
        served = self.pages.pop(name)
        served.page.close()
        for socket in list(served.sockets):
            await socket.close()
