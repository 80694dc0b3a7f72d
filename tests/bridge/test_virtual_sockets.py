"""Sockets between the threads of a host in virtual time, and what waits for several of them."""

from __future__ import annotations

import textwrap
from collections.abc import Callable
from pathlib import Path

import pytest

from isel_twin.bridge.virtual.virtual_host import HostRun, run_host
from isel_twin.core.twin import Twin

Host = Callable[[str], HostRun]


@pytest.fixture
def host(tmp_path: Path) -> Host:
    def run(text: str) -> HostRun:
        file = tmp_path / "host.py"
        file.write_text(textwrap.dedent(text))
        return run_host(Twin("4030", "imc-s8", "kinematic", line_speed=True), [str(file)], "COM4")

    return run


def shown(host: Host, capsys: pytest.CaptureFixture[str], text: str) -> list[str]:
    """What a host prints, twice the same, to the nanosecond."""
    outcomes = []
    for _ in range(2):
        done = host(text)
        assert (done.code, done.ending) == (0, "exit"), done.reason
        outcomes.append((capsys.readouterr().out.split("\n")[:-1], done.ended_ns))
    assert outcomes[0] == outcomes[1]
    return outcomes[0][0]


def test_an_echo_server_in_a_thread(host: Host, capsys: pytest.CaptureFixture[str]) -> None:
    """Replies come at once; a client waits its timeout, in virtual time, for one that does not come."""
    text = """
        import socket, threading, time

        def serve(server):
            line, _ = server.accept()
            while data := line.recv(100):
                time.sleep(0.25)
                if data != b"silent":
                    line.sendall(data)

        server = socket.create_server(("127.0.0.1", 0))
        print(server.getsockname())
        threading.Thread(target=serve, args=(server,)).start()
        client = socket.create_connection(server.getsockname(), timeout=0.5)
        begun = time.monotonic()
        for number in range(200):
            client.sendall(b"%d" % number)
            assert client.recv(100) == b"%d" % number
        print(f"{time.monotonic() - begun:.3f}")
        client.sendall(b"silent")
        begun = time.monotonic()
        try:
            client.recv(1)
        except TimeoutError as error:
            print(error, f"{time.monotonic() - begun:.3f}")
        client.close()
    """
    assert shown(host, capsys, text) == ["('127.0.0.1', 49152)", "50.000", "timed out 0.500"]


def test_a_web_server_beside_a_machine(host: Host, capsys: pytest.CaptureFixture[str]) -> None:
    text = """
        import http.server, threading, time, urllib.request
        import serial

        class Page(http.server.BaseHTTPRequestHandler):
            def do_GET(self):
                port.write(b"@0P\\r")
                reply = port.read(19)
                self.send_response(200)
                self.end_headers()
                self.wfile.write(reply)

            def log_message(self, *_): pass

        port = serial.Serial("COM4", 19200, timeout=60)
        port.write(b"@07\\r@0R7\\r")
        assert port.read(2) == b"00"
        port.write(b"@0A100,1000,0,100,0,100,0,100\\r")
        assert port.read(1) == b"0"
        server = http.server.ThreadingHTTPServer(("localhost", 8000), Page)
        threading.Thread(target=server.serve_forever).start()
        opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
        for host in ("localhost", "127.0.0.1"):
            print(opener.open(f"http://{host}:8000/").read().decode())
        server.shutdown()
        server.server_close()
    """
    assert shown(host, capsys, text) == ["0000064000000000000"] * 2


def test_an_asyncio_server_and_a_client_in_another_thread(host: Host, capsys: pytest.CaptureFixture[str]) -> None:
    text = """
        import asyncio, socket, threading, time

        async def answer(reader, writer):
            writer.write((await reader.readline()).upper())
            await asyncio.sleep(0.2)
            await writer.drain()
            writer.close()

        def ask(port):
            with socket.create_connection(("localhost", port)) as line, line.makefile("rw") as file:
                file.write("hello\\n")
                file.flush()
                print(file.read().strip())

        async def main():
            server = await asyncio.start_server(answer, "127.0.0.1", 0)
            port = server.sockets[0].getsockname()[1]
            await asyncio.to_thread(ask, port)
            reader, writer = await asyncio.open_connection("localhost", port)
            writer.write(b"again\\n")
            print((await reader.read()).decode().strip(), f"{asyncio.get_running_loop().time() - 1000:.3f}")
            writer.close()
            server.close()

        asyncio.run(main())
    """
    assert shown(host, capsys, text) == ["HELLO", "AGAIN 0.400"]


def test_one_wait_for_the_port_and_a_socket(host: Host, capsys: pytest.CaptureFixture[str]) -> None:
    """`select.select`, `select.poll` and a selector tell which of them it was."""
    text = """
        import select, selectors, socket, threading, time
        import serial

        def later(line):
            time.sleep(1.0)
            line.send(b"x")

        port = serial.Serial("COM4", 19200, timeout=1)
        here, there = socket.socketpair()
        selector = selectors.DefaultSelector()
        selector.register(port, selectors.EVENT_READ, "port")
        selector.register(here, selectors.EVENT_READ, "socket")
        poll = select.poll()
        poll.register(port, select.POLLIN)
        poll.register(here, select.POLLIN)
        names = {port.fileno(): "port", here.fileno(): "socket"}
        waits = [
            lambda: [key.data for key, _ in selector.select(0.3)],
            lambda: [names[number] for number, _ in poll.poll(300)],
            lambda: [names[item.fileno()] for item in select.select([port, here], [], [], 0.3)[0]],
        ]
        for wait in waits:
            begun = time.monotonic()
            print(wait(), f"{time.monotonic() - begun:.3f}")
            port.write(b"@07\\r")
            print(wait())
            port.read(1)
            threading.Thread(target=later, args=(there,)).start()
            while not (found := wait()): pass
            print(found, f"{time.monotonic() - begun:.2f}")
            here.recv(1)
    """
    assert shown(host, capsys, text) == ["[] 0.300", "['port']", "['socket'] 1.30"] * 3


def test_a_sender_waits_for_room_and_the_end_is_heard(host: Host, capsys: pytest.CaptureFixture[str]) -> None:
    """128 KiB, of which 64 KiB are on the way: the rest fits when the second 32 KiB have been read, after 1 s."""
    text = """
        import socket, threading, time

        def read_slowly(line):
            size = 0
            while data := line.recv(32768):
                size += len(data)
                time.sleep(1)
            print(size)

        here, there = socket.socketpair()
        reader = threading.Thread(target=read_slowly, args=(there,))
        reader.start()
        here.sendall(bytes(131072))
        print(f"{time.monotonic() - 1000:.2f}")
        here.shutdown(socket.SHUT_WR)
        reader.join()
        there.close()
        here.setblocking(False)
        assert here.recv(1) == b""
        try:
            here.send(b"x")
        except BrokenPipeError:
            print("nobody reads")
        here, there = socket.socketpair()
        here.setblocking(False)
        try:
            here.recv(1)
        except BlockingIOError:
            print("nothing yet")
    """
    assert shown(host, capsys, text) == ["1.00", "131072", "nobody reads", "nothing yet"]


def test_who_reads_no_more_is_sent_nothing(host: Host, capsys: pytest.CaptureFixture[str]) -> None:
    """By its own `shutdown`, though it stays open; and nothing is sent after the end that one has told oneself."""
    text = """
        import socket

        for reader in (0, 1):
            pair = socket.socketpair()
            pair[1].shutdown(socket.SHUT_RD) if reader else pair[0].shutdown(socket.SHUT_WR)
            try:
                pair[0].send(b"x")
            except BrokenPipeError:
                print("nobody reads")
            pair[1].send(b"y")
            print(pair[0].recv(1))
    """
    assert shown(host, capsys, text) == ["nobody reads", "b'y'"] * 2


def test_refusals_are_those_of_a_computer_without_a_network(host: Host, capsys: pytest.CaptureFixture[str]) -> None:
    """A discovery by broadcast finds nobody; a port nobody listens at, or somebody has, is answered as everywhere."""
    text = """
        import errno, socket

        def tried(call, *args):
            try:
                call(*args)
            except OSError as error:
                print(errno.errorcode[error.errno])

        seeker = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        seeker.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        tried(seeker.sendto, b"anybody?", ("255.255.255.255", 111))
        tried(seeker.sendto, b"anybody?", ("192.0.2.255", 111))
        tried(socket.create_connection, ("127.0.0.1", 9))
        server = socket.create_server(("", 5000))
        tried(socket.socket().bind, ("127.0.0.1", 5000))
        tried(socket.socket().bind, ("192.0.2.1", 5000))
        tried(socket.socket().recv, 1)
        server.close()
        socket.create_server(("", 5000)).close()
        mailbox = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        mailbox.bind(("127.0.0.1", 4000))
        seeker.sendto(b"letter", ("127.0.0.1", 4000))
        print(mailbox.recvfrom(100))
    """
    assert shown(host, capsys, text) == [
        *("ENETUNREACH", "ENETUNREACH", "ECONNREFUSED", "EADDRINUSE", "EADDRNOTAVAIL", "ENOTCONN"),
        "(b'letter', ('127.0.0.1', 49152))",
    ]


def test_a_closed_file_is_told_in_each_list_of_select(host: Host, capsys: pytest.CaptureFixture[str]) -> None:
    text = """
        import errno, os, select
        closed, other = os.pipe()
        os.close(closed)
        for lists in (([closed], [], []), ([], [closed], []), ([], [], [closed])):
            try:
                select.select(*lists, 0)
            except OSError as error:
                print(errno.errorcode[error.errno])
    """
    assert shown(host, capsys, text) == ["EBADF"] * 3


def test_a_deadlock_names_the_socket(host: Host) -> None:
    done = host("import socket\nsocket.create_server(('', 0)).accept()")
    assert (done.ending, done.code) == ("deadlock", 1)
    assert "MainThread in socket.accept (host.py:2)" in done.reason


def test_sockets_of_others_stay_real(host: Host) -> None:
    import selectors
    import socket

    real = socket.socket, selectors.DefaultSelector, socket.getaddrinfo
    assert host("import socket\nsocket.socketpair()").code == 0
    assert (socket.socket, selectors.DefaultSelector, socket.getaddrinfo) == real
