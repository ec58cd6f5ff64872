"""HTTP server of a live page: on this machine alone, for those who know its address, and of nothing but that page.

Every address begins with a token that is drawn when the server starts; a request without it, or one that names another
host than this machine (a page elsewhere whose name resolves to it), is refused. The threads of the server only hand
requests over: they are answered one after the other in the thread of the command, where all is computed.
"""

from __future__ import annotations

import json
import math
import os
import secrets
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from queue import Empty, Queue
from socketserver import TCPServer
from threading import Thread
from typing import Any, Final

from mcnav.errors import CampaignError, Problem
from mcnav.report.document.html import without_turns
from mcnav.studies.live import LiveCampaign
from mcnav.studies.live_run import REFUSED, in_one_line

LOOPBACK: Final = "127.0.0.1"
"""Address at which the server listens: other machines cannot reach it."""

EVERY: Final = 0.5
"""Seconds between two looks at the file."""

IDLE: Final = 30.0
"""Seconds after which a connection that asks nothing is closed."""

LARGEST: Final = 100_000
"""Bytes of the largest request."""

DIGITS: Final = 18
"""Digits of the longest whole number in a request."""

WRONG: Final = "403: this is not the address that mcnav live has printed; its token is missing or wrong"

Call = Callable[[LiveCampaign], str]
"""Function that answers a request; its text is the answer."""


class LiveServer(ThreadingHTTPServer):
    """A server that listens on this machine alone; `CampaignError` where its port is taken.

    Parameters
    ----------
    port : int
        Zero for a free one.
    """

    daemon_threads = True
    allow_reuse_address = os.name != "nt"  # Windows would let another program listen at the same port

    def __init__(self, port: int = 0) -> None:
        try:
            super().__init__((LOOPBACK, port), _Requests)
        except (OSError, OverflowError) as wrong:
            reason = getattr(wrong, "strerror", None) or str(wrong)
            message = f"got {port}: {reason}; leave the option out, and a free one is taken"
            raise CampaignError([Problem("--port", "", message)]) from None
        self.token = secrets.token_urlsafe(24)
        self.calls: Queue[tuple[Call, Future[str]] | None] = Queue()

    def server_bind(self) -> None:
        """Bind the socket without asking the network for the name of this machine."""
        TCPServer.server_bind(self)
        self.server_name, self.server_port = LOOPBACK, int(self.server_address[1])

    @property
    def hosts(self) -> tuple[str, str]:
        """Names by which the server may be asked."""
        return f"{LOOPBACK}:{self.server_port}", f"localhost:{self.server_port}"

    @property
    def address(self) -> str:
        """Address of the page."""
        return f"http://{self.hosts[0]}/{self.token}/"

    def ask(self, call: Call) -> str:
        """Have a call answered by the thread of the command."""
        answer: Future[str] = Future()
        self.calls.put((call, answer))
        return answer.result()

    def end(self) -> None:
        """Let `answer_requests` return."""
        self.calls.put(None)

    def handle_error(self, request: object, client_address: object) -> None:
        """Print nothing of connections that browsers give up."""


@contextmanager
def _listening(server: LiveServer) -> Iterator[None]:
    thread = Thread(target=server.serve_forever, args=(0.1,), daemon=True)
    thread.start()
    try:
        yield
    finally:
        server.shutdown()
        server.server_close()


def answer_requests(live: LiveCampaign, server: LiveServer) -> None:
    """Answer requests and watch the campaign's file, until `LiveServer.end` or an interrupt; its run ends then."""
    try:
        with _listening(server):
            while True:
                try:
                    asked = server.calls.get(timeout=EVERY)
                except Empty:
                    live.watch()
                    continue
                if asked is None:
                    return
                call, answer = asked
                try:
                    live.watch()
                    answer.set_result(call(live))
                except Exception as wrong:
                    answer.set_exception(wrong)
    finally:
        live.stop()


def _state(live: LiveCampaign) -> str:
    return without_turns(json.dumps(live.state(), ensure_ascii=False, allow_nan=False))


def _tuned(asked: dict[str, Any]) -> Call:
    revision = int(asked["revision"])
    factors = {str(path): float(factor) for path, factor in asked["factors"].items()}
    if not all(map(math.isfinite, factors.values())):
        raise ValueError("a factor is not finite")

    def call(live: LiveCampaign) -> str:
        live.tune(revision, factors)
        return _state(live)

    return call


def _confirmed(asked: dict[str, Any]) -> Call:
    number = int(asked["setting"])

    def call(live: LiveCampaign) -> str:
        live.confirm(number)
        return _state(live)

    return call


def _stopped(_: dict[str, Any]) -> Call:
    def call(live: LiveCampaign) -> str:
        live.stop()
        return _state(live)

    return call


ACTIONS: Final[dict[str, Callable[[dict[str, Any]], Call]]] = {
    "tune": _tuned, "confirm": _confirmed, "stop": _stopped,
}  # fmt: skip
"""Requests of the page that change something."""

SHOWN: Final[dict[str, tuple[str, Callable[[LiveCampaign, int], str]]]] = {
    "setting": ("text/html", LiveCampaign.setting_page),
    "report": ("text/html", LiveCampaign.report),
    "campaign": ("text/plain", LiveCampaign.campaign_file),
}
"""Further content, each of a setting by its number, with the type of its content."""


class _Requests(BaseHTTPRequestHandler):
    """Requests of one connection."""

    server: LiveServer
    timeout = IDLE
    server_version, sys_version = "mcnav", ""

    def do_GET(self) -> None:
        """Return the page, its state, or a page on one setting."""
        path = self._path()
        if path is None:
            return
        kind, _, number = path.partition("/")
        if path == "":
            self._answer("text/html", lambda live: live.page())
        elif path == "state":
            self._answer("application/json", _state)
        elif kind in SHOWN and number.isdecimal() and len(number) > DIGITS:
            self._send(HTTPStatus.BAD_REQUEST, "text/plain", f"400: the number has more than {DIGITS} digits")
        elif kind in SHOWN and number.isdecimal():
            content, shown = SHOWN[kind]
            self._answer(content, lambda live: shown(live, int(number)))
        else:
            self._send(HTTPStatus.NOT_FOUND, "text/plain", "404: there is nothing here")

    def do_POST(self) -> None:
        """Do what the page asks for, and return its state."""
        path = self._path()
        if path is None:
            return
        length = self.headers.get("Content-Length", "")
        if path not in ACTIONS or self.headers.get("Content-Type") != "application/json":
            self._send(HTTPStatus.NOT_FOUND, "text/plain", "404: there is nothing here")
        elif not length.isdecimal():
            self._send(HTTPStatus.BAD_REQUEST, "text/plain", "400: the header Content-Length is no whole number")
        elif len(length) > DIGITS or int(length) > LARGEST:
            self._send(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, "text/plain", "413: the request is too long")
        else:
            try:
                call = ACTIONS[path](json.loads(self.rfile.read(int(length))))
            except (ValueError, TypeError, KeyError, AttributeError, RecursionError, OverflowError):
                self._send(HTTPStatus.BAD_REQUEST, "text/plain", "400: this is not what the page asks")
            else:
                self._answer("application/json", call)

    def _path(self) -> str | None:
        """Return the path below the token; refuse requests that do not know it, or come from elsewhere."""
        given, _, path = self.path.partition("?")[0].removeprefix("/").partition("/")
        origin = self.headers.get("Origin")
        own = {f"http://{host}" for host in self.server.hosts}
        known = secrets.compare_digest(given.encode(errors="replace"), self.server.token.encode())
        if known and self.headers.get("Host") in self.server.hosts and (origin is None or origin in own):
            return path
        self._send(HTTPStatus.FORBIDDEN, "text/plain", WRONG)
        return None

    def _answer(self, kind: str, call: Call) -> None:
        """Have a call answered, and send its answer; what users can do something about is sent in one line."""
        try:
            text = self.server.ask(call)
        except REFUSED as wrong:
            self._send(HTTPStatus.CONFLICT, "text/plain", in_one_line(wrong))
        else:
            self._send(HTTPStatus.OK, kind, text)

    def _send(self, status: HTTPStatus, kind: str, text: str) -> None:
        content = text.encode()
        self.send_response(status)
        for name, value in {
            "Content-Type": f"{kind}; charset=utf-8",
            "Content-Length": str(len(content)),
            "Cache-Control": "no-store",
            "Referrer-Policy": "no-referrer",
            "X-Content-Type-Options": "nosniff",
            "X-Frame-Options": "DENY",
            "Cross-Origin-Resource-Policy": "same-origin",
        }.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, *_: object) -> None:
        """Print nothing of requests."""
