"""Serves a page and its calls to browsers of this user on this machine, and to nobody else.

The server listens on 127.0.0.1. The page's address contains a random token, and each call repeats
it in a header that foreign pages cannot send. A foreign Host (DNS rebinding) or Origin is refused,
and so are requests that are too large, too slow, or not JSON. A call has a name and a table of
values; no value of the page is used as a path.
"""

from __future__ import annotations

import contextlib
import hmac
import json
import math
import secrets
import signal
import threading
import traceback
from collections.abc import Callable, Mapping
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any, TypeAlias

from antiosc.base import checks
from antiosc.base.errors import AntioscError
from antiosc.base.texts import capitalised
from antiosc_app.live import content_policy, embedded_json, page_script

HOST = "127.0.0.1"
#: Header of calls with the token of the page's address.
TOKEN_HEADER = "X-Antiosc-Token"
#: Largest body of a call [bytes].
MAX_BODY_BYTES = 65_536
#: Largest headers of a call [bytes].
MAX_HEADER_BYTES = 16_384
#: Time limit [s] for each piece of a request to arrive.
PIECE_TIMEOUT = 10.0
#: Interval [s] at which the server checks whether it is closed.
POLL_INTERVAL = 0.1
#: Deepest nesting of a call's values.
MAX_DEPTH = 8
#: Headers of every answer.
COMMON_HEADERS = {
    "Cache-Control": "no-store",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cross-Origin-Opener-Policy": "same-origin",
}

#: A call: a function from its values to a JSON value.
PageCall: TypeAlias = Callable[[dict[str, Any]], object]


class RefusedRequest(Exception):
    """A request is refused, with this HTTP status and sentence."""

    def __init__(self, status: HTTPStatus, sentence: str) -> None:
        super().__init__(sentence)
        self.status = status


class PageServer(ThreadingHTTPServer):
    """Serves `page` (HTML, Content-Security-Policy), calls and reports by name, until closed."""

    daemon_threads = True

    def __init__(
        self,
        page: tuple[str, str],
        calls: Mapping[str, PageCall],
        reports: Mapping[str, Path] | None = None,
    ) -> None:
        super().__init__((HOST, 0), _PageRequest)
        self.token = secrets.token_urlsafe(24)
        self.calls = calls
        self.reports = {} if reports is None else reports
        self.page = page[0].encode()
        self.policy = page[1]
        self.hosts = {f"{name}:{self.server_port}" for name in (HOST, "localhost")}
        self.address = f"http://{HOST}:{self.server_port}/{self.token}/"

    def start(self) -> None:
        """Serve in a new thread."""
        # PETSc that another program started aborts the process on a broken pipe; signals can be
        # set in the main thread alone, as `antiosc open` and notebooks do
        with contextlib.suppress(ValueError, AttributeError):
            signal.signal(signal.SIGPIPE, signal.SIG_IGN)
        threading.Thread(target=self.serve_forever, args=(POLL_INTERVAL,), daemon=True).start()

    def close(self) -> None:
        """Stop; requests in progress are not interrupted."""
        self.shutdown()
        self.server_close()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Ignore broken connections."""


class _PageRequest(BaseHTTPRequestHandler):
    """One request on a connection, which is closed after it."""

    server: PageServer
    timeout = PIECE_TIMEOUT
    server_version = "antiosc"
    sys_version = ""

    def do_GET(self) -> None:
        self._send_answer(self._page_content)

    def do_POST(self) -> None:
        self._send_answer(self._call_answer)

    def _send_answer(self, work: Callable[[], tuple[str, bytes]]) -> None:
        """Send the result (content type, content) of `work`, or its refusal."""
        try:
            self._check_source()
            kind, content = work()
            status = HTTPStatus.OK
        except RefusedRequest as error:
            kind = "text/plain"
            content = f"{error}\n".encode()
            status = error.status
        self.send_response(status)
        for name, value in {
            **COMMON_HEADERS,
            "Content-Security-Policy": self._content_policy(),
        }.items():
            self.send_header(name, value)
        self.send_header("Content-Type", f"{kind}; charset=utf-8")
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        self.wfile.write(content)

    def _check_source(self) -> None:
        """Refuse a request whose headers do not come from the page."""
        headers = self.headers
        if sum(len(name) + len(value) for name, value in headers.items()) > MAX_HEADER_BYTES:
            raise RefusedRequest(
                HTTPStatus.REQUEST_HEADER_FIELDS_TOO_LARGE, "the headers are too long."
            )
        hosts = headers.get_all("Host", [])
        if len(hosts) != 1 or hosts[0] not in self.server.hosts:
            raise RefusedRequest(HTTPStatus.FORBIDDEN, "the Host is not this server.")
        origins = headers.get_all("Origin", [])
        if any(origin != f"http://{hosts[0]}" for origin in origins):
            raise RefusedRequest(HTTPStatus.FORBIDDEN, "another Origin may not ask.")
        if "Transfer-Encoding" in headers:
            raise RefusedRequest(HTTPStatus.NOT_IMPLEMENTED, "a body needs a Content-Length.")

    def _check_token(self, token: str) -> None:
        """Refuse a wrong token."""
        if not hmac.compare_digest(token.encode(), self.server.token.encode()):
            raise RefusedRequest(HTTPStatus.FORBIDDEN, "the token is missing or wrong.")

    def _page_content(self) -> tuple[str, bytes]:
        """(content type, content) of the page, or of a report named in the address."""
        parts = self.path.split("/")
        self._check_token(parts[1] if len(parts) > 1 else "")
        if parts[2:] == [""]:
            return "text/html", self.server.page
        try:
            return "text/html", self.server.reports["/".join(parts[2:])].read_bytes()
        except (KeyError, OSError):
            raise RefusedRequest(HTTPStatus.NOT_FOUND, "there is no such page.") from None

    def _content_policy(self) -> str:
        """Content-Security-Policy of the answer, for the page or for a report."""
        is_report = self.path.rpartition("/")[2] in self.server.reports
        return content_policy(page_script()) if is_report else self.server.policy

    def _call_answer(self) -> tuple[str, bytes]:
        """(content type, content) of the answer to a call, or of its error."""
        self._check_token(self.headers.get(TOKEN_HEADER, ""))
        call = self.server.calls.get(self.path.removeprefix("/"))
        if call is None:
            raise RefusedRequest(HTTPStatus.NOT_FOUND, "there is no such call.")
        values = self._call_values()
        try:
            answer = {"answer": call(values)}
        except AntioscError as error:
            answer = {"error": capitalised(str(error))}
            if getattr(error, "radius", None):  # a larger patch mends it
                answer["field"] = "radius"
        except Exception as error:  # or the page would wait for a server that is well
            traceback.print_exc()
            name = type(error).__name__
            answer = {"error": f"The program failed ({name}: {error}); the terminal has more."}
        return "application/json", embedded_json(answer).encode()

    def _call_values(self) -> dict[str, Any]:
        """The values of a call: a JSON table without NaN, not nested too deep."""
        if self.headers.get("Content-Type") != "application/json":
            raise RefusedRequest(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, "a call is application/json.")
        length = self.headers.get_all("Content-Length", [])
        if len(length) != 1 or not length[0].isascii() or not length[0].isdigit():
            raise RefusedRequest(HTTPStatus.LENGTH_REQUIRED, "a call needs one Content-Length.")
        if len(length[0]) > 9 or int(length[0]) > MAX_BODY_BYTES:
            raise RefusedRequest(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, "the call is too large.")
        body = self.rfile.read(int(length[0]))
        if len(body) < int(length[0]):
            raise RefusedRequest(HTTPStatus.BAD_REQUEST, "the call is cut.")
        try:
            text = body.decode()
            if checks.nests_deeper(text, MAX_DEPTH + 1):  # the table itself is one
                raise ValueError("too deep")
            values = json.loads(text, parse_constant=_finite_number, parse_float=_finite_number)
        except ValueError:
            values = None
        if not isinstance(values, dict):
            raise RefusedRequest(HTTPStatus.BAD_REQUEST, "the call is not a table in JSON.")
        return values

    def log_message(self, *_: object) -> None:
        """Print no requests."""


def _finite_number(text: str) -> float:
    """The number that a text states; ValueError for NaN and infinity."""
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(text)
    return value
