"""Who is let in, what is served, and that none of it comes from elsewhere."""

from __future__ import annotations

import contextlib
import http.client
import json
import socket
import threading
from types import SimpleNamespace

import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from isel_twin.bridge.operate.panel import guarded
from isel_twin.bridge.operate.panel.gate import Gate
from isel_twin.bridge.operate.panel.guest import Panel
from isel_twin.cli import main
from tests.panel.conftest import LOOPBACK, WAIT_S

LOCAL, WIDE, TOKEN = "127.0.0.1:8217", "0.0.0.0:8217", "sesame"


def get(port: int, path: str = "/", **headers: str) -> tuple[int, dict[str, str], bytes]:
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=WAIT_S)
    connection.request("GET", path, headers={name.replace("_", "-"): value for name, value in headers.items()})
    answer = connection.getresponse()
    data = answer.read()
    connection.close()
    return answer.status, dict(answer.getheaders()), data


@pytest.mark.parametrize(
    ("headers", "why"),
    [
        ({"Host": "127.0.0.1:8217"}, None),
        ({"Host": "localhost:8217"}, None),
        ({"Host": "[::1]:8217"}, None),
        ({"Host": "127.0.0.1:8217", "Origin": "http://127.0.0.1:8217"}, None),
        ({"Host": "localhost:8217", "Origin": "http://localhost:8217"}, None),
        ({"Host": "127.0.0.1:8217", "Origin": "http://elsewhere.example"}, "origin"),
        ({"Host": "127.0.0.1:8217", "Origin": "http://127.0.0.1:8000"}, "origin"),
        ({"Host": "127.0.0.1:8217", "Origin": "https://127.0.0.1:8217"}, "origin"),
        ({"Host": "127.0.0.1:8217", "Origin": "null"}, "origin"),
        ({"Host": "127.0.0.1:8217", "Origin": ""}, "origin"),
        ({"Host": "elsewhere.example:8217", "Origin": "http://elsewhere.example:8217"}, "this computer"),
        ({"Host": "127.0.0.1.elsewhere.example"}, "this computer"),
        ({"Host": "user@[::1"}, "this computer"),
        ({}, "this computer"),
        ({"Host": "127.0.0.1:8217", "Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "no-cors"}, "origin"),
    ],
)
def test_who_is_let_in_on_the_loopback_interface(headers: dict[str, str], why: str | None):
    refusal = Gate(LOCAL, None).refusal("/", headers)
    assert refusal is None if why is None else refusal is not None and why in refusal


@pytest.mark.parametrize(
    ("path", "cookie", "let_in"),
    [
        ("/", "", False),
        (f"/?token={TOKEN}", "", True),
        ("/?token=wrong", "", False),
        ("/?token=", "", False),
        ("/operate", f"panel_8217={TOKEN}", True),
        ("/operate", f"other=1; panel_8217={TOKEN}", True),
        ("/operate", f"panel_9999={TOKEN}", False),
        ("/operate", "panel_8217=wrong", False),
        ("/operate", "panel_8217=\udcff", False),
        ("/operate", '"[]{}=;;', False),
    ],
)
def test_beyond_it_nobody_without_the_token(path: str, cookie: str, let_in: bool):
    refusal = Gate(WIDE, TOKEN).refusal(path, {"Host": "workshop:8217", "Cookie": cookie})
    assert (refusal is None) is let_in
    assert let_in or "token" in str(refusal)


def test_a_token_is_made_up_beyond_the_loopback_interface_and_stands_in_the_link():
    panel = Panel("0.0.0.0:0")
    try:
        assert panel.token is not None
        assert len(panel.token) >= 16
        assert panel.url == f"http://{socket.gethostname()}:{panel.address.split(':')[1]}/?token={panel.token}"
    finally:
        panel.close()


def test_the_page_and_the_scene_are_served_with_a_policy(bench):
    here = bench()
    for path, kind in (("/", "html"), ("/panel.css", "css"), ("/panel.js", "javascript"), ("/scene", "html")):
        status, headers, data = get(here.port, path)
        assert (status, len(data) > 1000) == (200, True)
        assert kind in headers["Content-Type"]
        assert "default-src 'none'" in headers["Content-Security-Policy"]
        assert "http" not in headers["Content-Security-Policy"]
    assert get(here.port, "/../../etc/passwd")[0] == 404
    assert get(here.port, "/nothing")[0] == 404


def test_another_origin_is_refused_at_both_sockets_and_at_the_page(bench):
    here = bench()
    for path in ("operate", "scene", ""):
        for origin in ("http://elsewhere.example", "null", f"http://127.0.0.1:{here.port + 1}"):
            with pytest.raises(InvalidStatus) as caught:
                connect(f"ws://127.0.0.1:{here.port}/{path}", origin=origin)
            assert caught.value.response.status_code == 403
    status, _, data = get(here.port, "/", Origin="http://elsewhere.example")
    assert (status, data) == (403, b"the page comes from another origin\n")
    assert get(here.port, "/", Host="elsewhere.example")[0] == 403


def test_the_token_of_the_link_becomes_a_cookie(bench):
    here = bench(token=TOKEN)
    assert get(here.port, "/")[0] == 403
    with pytest.raises(InvalidStatus):
        connect(f"ws://127.0.0.1:{here.port}/operate")
    status, headers, _ = get(here.port, f"/?token={TOKEN}")
    assert status == 200
    cookie = headers["Set-Cookie"]
    assert "HttpOnly" in cookie
    assert "SameSite=Strict" in cookie
    assert get(here.port, "/panel.js", Cookie=cookie.split(";")[0])[0] == 200
    with connect(f"ws://127.0.0.1:{here.port}/operate", additional_headers={"Cookie": cookie.split(";")[0]}) as page:
        assert "about" in json.loads(page.recv(timeout=WAIT_S))


def test_what_is_no_http_hurts_nobody(bench, browser):
    here = bench()
    for junk in (b"\0" * 100, b"GET / HTTP/1.1\r\n\r\n", b"POST / HTTP/1.1\r\nHost: localhost\r\n\r\n", b"@07\r"):
        with socket.create_connection(("127.0.0.1", here.port), timeout=WAIT_S) as other:
            other.sendall(junk)
    assert browser(here).ask(state=True)


def test_a_taken_port_is_one_line():
    with socket.create_server(("127.0.0.1", 0)) as taken:
        address = f"127.0.0.1:{taken.getsockname()[1]}"
        with pytest.raises(OSError, match="choose another address") as caught:
            Panel(address)
        assert "\n" not in str(caught.value)


def test_nothing_is_said_on_the_standard_output(bench, capfd):
    here = bench()
    here.server.stop()
    here.thread.join(WAIT_S)
    assert capfd.readouterr() == ("", "")


def test_a_panel_may_be_closed_before_it_has_a_server():
    panel = Panel(LOOPBACK)
    panel.close()
    panel.close()


def test_nobody_can_have_the_scene_shared_through_a_public_server(bench, monkeypatch: pytest.MonkeyPatch):
    """viser would do so at the request of any client."""
    import viser

    def share(*_: object, **__: object) -> None:
        raise AssertionError("somebody asked for a tunnel")

    monkeypatch.setattr(viser.ViserServer, "request_share_url", share)
    site = bench().panel._site._viser
    assert site.request_share_url() is None


def never(*_: object) -> None:
    """Lets everybody in."""


@pytest.mark.parametrize(
    ("module", "why"),
    [
        (SimpleNamespace(websockets=None), "opens a port of its own"),
        (SimpleNamespace(), "has no such door"),
        (guarded.viser_infra, "lets a foreign page in"),
    ],
    ids=["another name", "no name", "no gate"],
)
def test_a_viser_that_is_not_guarded_does_not_start(module: object, why: str, monkeypatch: pytest.MonkeyPatch):
    """As one that has changed the name that is exchanged, or what it calls by it; nothing of it is left behind."""
    monkeypatch.setattr(guarded, "viser_infra", module)
    before = set(threading.enumerate())
    with socket.create_server(("127.0.0.1", 0)) as listener:
        listener.setblocking(False)
        with pytest.raises(guarded.UnguardedError, match=why) as caught:
            guarded.start(listener, never, never)  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)
    for thread in set(threading.enumerate()) - before:
        thread.join(WAIT_S)
        assert not thread.is_alive()


def test_serve_says_so_in_one_line(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    monkeypatch.setattr(guarded, "viser_infra", SimpleNamespace())
    with pytest.raises(SystemExit) as caught:
        main(["serve", "--tcp", LOOPBACK, "--panel", LOOPBACK, "--plant", "kinematic"])
    said = capsys.readouterr()
    assert (caught.value.code, said.out) == (2, "")
    assert said.err.startswith("isel-twin: --panel: not started, as this viser (")
    assert len(said.err.splitlines()) == 1


def test_a_connection_that_says_nothing_holds_up_no_end(bench):
    """Browsers open some in advance; a server that waits for their requests stands in the way of the next one."""
    before = set(threading.enumerate())
    here = bench()
    with socket.create_connection(("127.0.0.1", here.port)) as spare:
        assert get(here.port, Host=f"127.0.0.1:{here.port}")[0] == 200  # so the server has taken the one before
        begun = set(threading.enumerate()) - before
        here.close()
        assert [thread.name for thread in begun if thread.is_alive() and "Executor" not in thread.name] == []
        with contextlib.suppress(ConnectionResetError):
            assert spare.recv(1) == b""
