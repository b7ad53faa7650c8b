"""The server of `antiosc open` answers its own page on this machine, and refuses all others."""

from __future__ import annotations

import json
import re
import socket
import urllib.request
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from antiosc.base.errors import InputError, RangeError
from antiosc_app import server, view
from antiosc_app.live import content_policy, page_script
from antiosc_app.server import TOKEN_HEADER, PageServer

OK, NO = b"200", b"403"


def answered(values):
    if "wrong" in values:
        raise InputError("wrong must not be given.")
    if "refused" in values:
        raise InputError(values["refused"])
    if "small" in values:
        error = RangeError("the patch is too small.")
        error.radius = values["small"]
        raise error
    if "broken" in values:
        raise ZeroDivisionError("by 0")
    return {"got": values}


@pytest.fixture
def served(monkeypatch):
    monkeypatch.setattr(server, "PIECE_TIMEOUT", 1.0)
    monkeypatch.setattr(server._PageRequest, "timeout", 1.0)
    one = PageServer(("<title>part</title>", "default-src 'none'"), {"blow": answered}, {})
    one.start()
    yield one
    one.close()


def sent(served, data: bytes) -> bytes:
    """What comes back for some bytes, as long as the connection lasts; at most ten seconds."""
    with socket.create_connection(("127.0.0.1", served.server_port), timeout=10) as line:
        line.sendall(data)
        found = b""
        try:
            while piece := line.recv(65536):
                found += piece
        except ConnectionResetError:
            pass
    return found


def request(served, *, method="POST", path="/blow", body=b"{}", drop=(), **changed) -> bytes:
    """A call as the page makes it, with other headers: `drop` leaves some out."""
    headers = {
        "Host": f"127.0.0.1:{served.server_port}",
        "Origin": f"http://127.0.0.1:{served.server_port}",
        "Content-Type": "application/json",
        "Content-Length": str(len(body)),
        TOKEN_HEADER: served.token,
    }
    headers |= {name.replace("_", "-"): value for name, value in changed.items()}
    lines = [f"{name}: {value}" for name, value in headers.items() if name not in drop]
    return "\r\n".join([f"{method} {path} HTTP/1.1", *lines, "", ""]).encode() + body


def status(reply: bytes) -> bytes:
    return reply.split(b" ", 2)[1] if reply.startswith(b"HTTP/") else b""


def test_the_page_and_its_calls_are_answered(served):
    body = json.dumps({"a": [1, 2.5, "<b>"]}).encode()
    reply = sent(served, request(served, body=body))
    assert status(reply) == OK
    assert json.loads(reply.split(b"\r\n\r\n")[1]) == {"answer": {"got": {"a": [1, 2.5, "<b>"]}}}
    host = f"localhost:{served.server_port}"
    assert status(sent(served, request(served, Host=host, Origin=f"http://{host}"))) == OK
    page = sent(served, request(served, method="GET", path=f"/{served.token}/", drop=("Origin",)))
    assert status(page) == OK
    assert b"<title>part</title>" in page
    for header in (b"Content-Security-Policy: default-src 'none'", b"no-store", b"no-referrer"):
        assert header in page
    refused = sent(served, request(served, body=b'{"wrong": 1}'))
    assert json.loads(refused.split(b"\r\n\r\n")[1]) == {"error": "Wrong must not be given."}
    small = json.loads(sent(served, request(served, body=b'{"small": 1}')).split(b"\r\n\r\n")[1])
    assert small == {"error": "The patch is too small.", "field": "radius"}  # which is marked


def test_a_report_that_was_written_is_served_with_its_own_policy(served, tmp_path):
    path = tmp_path / "part.html"
    path.write_text("<title>report</title>", encoding="utf-8")
    served.reports["report_1"] = path
    get = {"method": "GET", "drop": ("Origin",)}
    reply = sent(served, request(served, path=f"/{served.token}/report_1", **get))
    assert status(reply) == OK
    assert b"<title>report</title>" in reply
    assert f"Content-Security-Policy: {content_policy(page_script())}".encode() in reply
    for address in (f"/{served.token}/{path}", "/x/report_1", f"/{served.token}/report_1/x"):
        assert status(sent(served, request(served, path=address, **get))) in (b"404", NO)
    path.unlink()
    assert status(sent(served, request(served, path=f"/{served.token}/report_1", **get))) == b"404"


def test_an_error_is_a_sentence_on_the_page(served):
    for told, shown in (("the force is 2 N.", "The force is 2 N."), ("a.stp has no faces.",) * 2):
        reply = sent(served, request(served, body=json.dumps({"refused": told}).encode()))
        assert json.loads(reply.split(b"\r\n\r\n")[1])["error"] == shown


def test_a_defect_is_told_on_the_page_and_on_the_terminal(served, capsys):
    reply = sent(served, request(served, body=b'{"broken": 1}'))
    assert status(reply) == OK
    assert "(ZeroDivisionError: by 0)" in json.loads(reply.split(b"\r\n\r\n")[1])["error"]
    assert "Traceback" in capsys.readouterr().err


HOSTILE = {
    "no token": ({"drop": (TOKEN_HEADER,)}, NO),
    "wrong token": ({TOKEN_HEADER: "x" * 32}, NO),
    "token of other signs": ({TOKEN_HEADER: "ü" * 16}, NO),
    "no Host": ({"drop": ("Host",)}, NO),
    "rebound name": ({"Host": "evil.example"}, NO),
    "rebound name, right port": ({"Host": "evil.example:{port}"}, NO),
    "other port": ({"Host": "127.0.0.1:1"}, NO),
    "foreign Origin": ({"Origin": "https://evil.example"}, NO),
    "Origin of another port": ({"Origin": "http://127.0.0.1:1"}, NO),
    "Origin null": ({"Origin": "null"}, NO),
    "https Origin": ({"Origin": "https://127.0.0.1:{port}"}, NO),
    "form": ({"Content_Type": "application/x-www-form-urlencoded"}, b"415"),
    "plain text": ({"Content_Type": "text/plain"}, b"415"),
    "no kind": ({"drop": ("Content-Type",)}, b"415"),
    "no length": ({"drop": ("Content-Length",)}, b"411"),
    "length below 0": ({"Content_Length": "-1"}, b"411"),
    "length in words": ({"Content_Length": "ten"}, b"411"),
    "length of other digits": ({"Content_Length": "٣"}, b"411"),
    "large": ({"Content_Length": "65537"}, b"413"),
    "huge": ({"Content_Length": "9" * 4000}, b"413"),
    "in pieces": ({"Transfer_Encoding": "chunked"}, b"501"),
    "no JSON": ({"body": b"{"}, b"400"),
    "no text": ({"body": b"\xff\xfe{}"}, b"400"),
    "a list": ({"body": b"[1]"}, b"400"),
    "NaN": ({"body": b'{"a": NaN}'}, b"400"),
    "infinity": ({"body": b'{"a": 1e999}'}, b"400"),
    "deep": ({"body": b'{"a": ' + b"[" * 30000 + b"]" * 30000 + b"}"}, b"400"),
    "nested": ({"body": b'{"a": [[[[[[[[[1]]]]]]]]]}'}, b"400"),
    "unknown call": ({"path": "/quit"}, b"404"),
    "method of a call": ({"path": "/__class__"}, b"404"),
    "traversal": ({"path": "/../../etc/passwd"}, b"404"),
    "absolute": ({"path": "/blow/../../etc/passwd"}, b"404"),
    "page without token": ({"method": "GET", "path": "/"}, NO),
    "page of another token": ({"method": "GET", "path": "/{wrong}/"}, NO),
    "file beside the page": ({"method": "GET", "path": "/{token}/../../etc/passwd"}, b"404"),
    "call as a page": ({"method": "GET", "path": "/{token}/blow"}, b"404"),
    "put": ({"method": "PUT"}, b"501"),
    "options": ({"method": "OPTIONS"}, b"501"),
    "long header": ({"X_Long": "x" * 20000}, b"431"),
    "very long header": ({"X_Long": "x" * 70000}, b"431"),
    "long address": ({"path": "/" + "x" * 70000}, b"414"),
}


@pytest.mark.parametrize("case", HOSTILE)
def test_hostile_requests_are_refused(served, case):
    changed, expected = HOSTILE[case]
    names = {"port": served.server_port, "token": served.token, "wrong": "x" * 32}
    filled = {
        key: value.format(**names) if isinstance(value, str) and "{" in value else value
        for key, value in changed.items()
    }
    assert status(sent(served, request(served, **filled))) == expected
    assert status(sent(served, request(served))) == OK


def test_many_headers_and_two_hosts_are_refused(served):
    plain = request(served)
    first, rest = plain.split(b"\r\n", 1)
    more = b"".join(b"X-%d: 1\r\n" % k for k in range(200))
    assert status(sent(served, first + b"\r\n" + more + rest)) == b"431"
    assert status(sent(served, first + b"\r\nHost: evil.example\r\n" + rest)) == NO
    assert status(sent(served, first + b"\r\nContent-Length: 2\r\n" + rest)) == b"411"


@pytest.mark.slow
@pytest.mark.parametrize("cut", [0, 40, -1])
def test_who_does_not_finish_is_cut_off(served, cut):
    whole = request(served, body=b'{"a": 1}')
    assert status(sent(served, whole[:cut])) != OK  # its end comes, soon
    assert status(sent(served, request(served))) == OK


def test_the_token_stands_in_no_command_line_of_a_browser(tmp_path, monkeypatch):
    part = tmp_path / "part.step"
    part.write_text("ISO-10303-21;")
    seen = []

    def browse(address):
        page = Path(urllib.request.url2pathname(urlsplit(address).path))
        seen.append((address, page.read_text(), page.stat().st_mode & 0o777))
        raise KeyboardInterrupt

    monkeypatch.setattr(view.webbrowser, "open", browse)
    view.serve_until_interrupted(str(part), browser=True)
    ((address, text, mode),) = seen
    token = re.search(r"http://127.0.0.1:\d+/([^/]+)/", text)[1]
    assert mode == 0o600
    assert len(token) >= 32
    assert token not in address
    assert not Path(urlsplit(address).path).exists()  # with the program


@pytest.mark.parametrize(
    "options",
    [{"unit": "parsec"}, {"size": float("nan")}, {"size": -1.0}, {"piece": 0}],
)
def test_options_are_refused_before_the_page_opens(tmp_path, options):
    part = tmp_path / "part.step"
    part.write_text("ISO-10303-21;")
    given = dict.fromkeys(("unit", "size", "piece", "contact")) | options
    with pytest.raises(InputError, match=next(iter(options))):
        view.serve_until_interrupted(str(part), **given, browser=False)


def test_it_listens_on_this_machine_alone(served):
    assert served.server_address[0] == "127.0.0.1"
    assert len(served.token) >= 32
