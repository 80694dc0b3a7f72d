"""Sockets between the threads of a host in virtual time (bridge/25).

    server.accept, .recv, .sendall, select ...  -->  Turns.wait: until another thread of the host has sent, there is
                                                     room, or the timeout is over
    a datagram to any other computer            -->  OSError ENETUNREACH, as on a computer without a network
    a connection to any other computer          -->  the host ends with a reason (refusals.py)

What is sent has arrived at once. The numbers of ports that the host leaves open count from FIRST_PORT, so they are the
same every time; nothing outside the process can reach them. Each socket keeps a real one, not connected to anything:
its file number is nobody else's, and options set on it are remembered.
"""

from __future__ import annotations

import errno
import os
import socket
import weakref
from collections import deque
from collections.abc import Callable, Iterable
from typing import Any, NoReturn

from isel_twin.bridge.virtual.host_thread import HostEnded
from isel_twin.bridge.virtual.refusals import SERVE, refuse
from isel_twin.bridge.virtual.stand_in import StandIn
from isel_twin.bridge.virtual.turns import Turns, here

FIRST_PORT = 49_152  # first of the dynamic ports (RFC 6335)
ROOM = 65_536  # bytes on the way in one direction before a sender waits
_ANY = ("", "0.0.0.0", "::", "<any>")
_LOCAL = ("localhost", "127.0.0.1", "::1")
_UNIX = getattr(socket, "AF_UNIX", None)

Real = socket.socket
_Address = Any  # (host, port), or a path of the UNIX family


class _Pipe:
    """Bytes on their way from one socket to another."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.ended = False  # no more is sent: the sender has ended it, or the receiver is deaf
        self.deaf = False  # the receiver reads no more


class Network:
    """The sockets of one host."""

    def __init__(self) -> None:
        self.open: weakref.WeakValueDictionary[int, VirtualSocket] = weakref.WeakValueDictionary()  # by file number
        self.bound: weakref.WeakValueDictionary[Any, VirtualSocket] = weakref.WeakValueDictionary()
        self._next_port = FIRST_PORT

    def find(self, file: Any) -> VirtualSocket | None:
        """The socket that is meant by an object or a file number."""
        return file if isinstance(file, VirtualSocket) else self.open.get(file) if isinstance(file, int) else None

    def free_port(self) -> int:
        self._next_port += 1
        return self._next_port - 1


def _error(number: int) -> NoReturn:
    raise OSError(number, os.strerror(number))


def _is_local(host: str) -> bool:
    return host in _ANY or host in _LOCAL or host.startswith("127.") or host == socket.gethostname()


class VirtualSocket(Real):
    """A socket of a host. In a thread that is not the host's a real one is made."""

    def __new__(cls, *args: Any, **kwargs: Any) -> Any:
        return Real(*args, **kwargs) if here() is None else super().__new__(cls)

    def __init__(self, family: int = -1, type: int = -1, proto: int = -1, fileno: int | None = None) -> None:
        if fileno is not None:
            refuse("a socket made of a file number (ssl, multiprocessing, socket.fromfd)", SERVE)
        super().__init__(family, type, proto)
        if self.family not in (socket.AF_INET, socket.AF_INET6, _UNIX):
            refuse(f"a socket of the family {getattr(self.family, 'name', self.family)}", SERVE)
        self._network: Network = self._turns().network
        self._network.open[self.fileno()] = self
        self._here: _Address | None = None  # address it is bound to
        self._there: _Address | None = None  # address it is connected to
        self._in: _Pipe | None = None
        self._out: _Pipe | None = None
        self._calls: deque[VirtualSocket] | None = None  # connections that wait for `accept`; None: it does not listen
        self._backlog = 0
        self._datagrams: deque[tuple[bytes, _Address]] = deque()

    @staticmethod
    def _turns() -> Turns:
        active = here()
        if active is None:
            raise HostEnded(1)  # the host is over
        return active

    def _wait(self, ready: Callable[[], bool], what: str) -> None:
        """Wait until `ready`, as long as the timeout allows."""
        active = self._turns()
        if ready():
            active.free_look()
            return
        timeout_s = self.gettimeout()
        if timeout_s == 0:
            active.look()
            if not ready():
                raise BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN))
        elif not active.wait(ready, active.deadline(timeout_s), f"socket.{what}"):
            raise TimeoutError("timed out")
        self._check_open()

    def _check_open(self) -> None:
        if self.fileno() < 0:
            _error(errno.EBADF)

    # readiness, for select

    @property
    def readable(self) -> bool:
        """True if `recv` or `accept` would not wait."""
        if self.fileno() < 0 or self._calls:
            return True
        return bool(self._datagrams) or (self._in is not None and bool(self._in.data or self._in.ended))

    @property
    def writable(self) -> bool:
        """True if `send` would not wait."""
        return self._calls is None and (self._out is None or self._out.deaf or len(self._out.data) < ROOM)

    # addresses

    def _key(self, address: _Address) -> Any:
        """What listens under an address has this key. Raises OSError for addresses of others."""
        if self.family == _UNIX:
            return address
        host, port = address[:2]
        if not isinstance(host, str) or not isinstance(port, int):
            raise TypeError("an address is (host, port)")
        if not 0 <= port <= 65_535:
            raise OverflowError("port must be 0-65535.")
        return (self.type, port) if _is_local(host) else None

    def bind(self, address: _Address, /) -> None:
        key = self._key(address)
        self._check_open()
        if self._here is not None:
            _error(errno.EINVAL)
        if self.family != _UNIX:
            if key is None and self.type != socket.SOCK_DGRAM:
                _error(errno.EADDRNOTAVAIL)
            port = address[1] or self._network.free_port()
            host = "127.0.0.1" if address[0] == "localhost" else address[0] or "0.0.0.0"
            address = (host, port, *address[2:])
            key = (self.type, port)
        shared = self.type == socket.SOCK_DGRAM and self.getsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR)
        if self._network.bound.get(key) is not None and not shared:
            _error(errno.EADDRINUSE)
        self._network.bound[key] = self
        self._here = address

    def getsockname(self) -> Any:
        self._check_open()
        return self._here if self._here is not None else "" if self.family == _UNIX else ("0.0.0.0", 0)

    def getpeername(self) -> Any:
        self._check_open()
        if self._there is None:
            _error(errno.ENOTCONN)
        return self._there

    # connections

    def listen(self, backlog: int = 128, /) -> None:
        self._check_open()
        if self._here is None:
            self.bind(("0.0.0.0", 0))
        self._calls = self._calls or deque()
        self._backlog = max(1, backlog)

    def accept(self) -> tuple[VirtualSocket, Any]:
        if self._calls is None:
            _error(errno.EINVAL)
        calls = self._calls
        self._wait(lambda: bool(calls) or self.fileno() < 0, "accept")
        made = calls.popleft()
        return made, made._there

    def connect(self, address: _Address, /) -> None:
        key = self._key(address)
        self._check_open()
        if self.type == socket.SOCK_DGRAM:
            if key is None:
                _error(errno.ENETUNREACH)
            self._there = address
            return
        if self._there is not None:
            _error(errno.EISCONN)
        if key is None:
            refuse(f"a connection to {address[0]}, another computer,", SERVE)
        server = self._network.bound.get(key)
        if server is None or server._calls is None:
            _error(errno.ENOENT if self.family == _UNIX and server is None else errno.ECONNREFUSED)
        calls = server._calls
        self._wait(lambda: len(calls) <= server._backlog, "connect")
        made = type(self)(self.family, self.type, self.proto)
        if self._here is None:
            self._here = "" if self.family == _UNIX else ("127.0.0.1", self._network.free_port())
        self._there = address
        made._here, made._there = address, self._here
        _join(self, made)
        calls.append(made)

    def connect_ex(self, address: _Address, /) -> int:
        try:
            self.connect(address)
        except OSError as error:
            return error.errno or errno.EAGAIN
        return 0

    def shutdown(self, how: int, /) -> None:
        self._check_open()
        if self._in is None:
            _error(errno.ENOTCONN)
        self._end(reads=how != socket.SHUT_WR, writes=how != socket.SHUT_RD)

    def _end(self, *, reads: bool, writes: bool) -> None:
        if writes and self._out is not None:
            self._out.ended = True
        if reads and self._in is not None:
            self._in.deaf = self._in.ended = True

    def close(self) -> None:
        """Close it once no file of `makefile` needs it."""
        number = self.fileno()
        super().close()
        if number >= 0 and self.fileno() < 0:
            self._gone(number)

    def _gone(self, number: int) -> None:
        self._network.open.pop(number, None)
        for key, bound in list(self._network.bound.items()):
            if bound is self:
                del self._network.bound[key]
        self._end(reads=True, writes=True)
        for call in self._calls or ():
            call._end(reads=True, writes=True)

    def __del__(self) -> None:
        if getattr(self, "_network", None) is not None:
            self._end(reads=True, writes=True)

    def detach(self) -> int:
        refuse("the file number of a socket by itself (ssl, multiprocessing, socket.dup)", SERVE)

    def dup(self) -> Any:
        self.detach()

    # bytes

    def recv(self, size: int, flags: int = 0, /) -> bytes:
        if size < 0:
            raise ValueError("negative buffersize in recv")
        self._check_open()
        if self.type == socket.SOCK_DGRAM:
            return self.recvfrom(size, flags)[0]
        pipe = self._in
        if pipe is None:
            _error(errno.ENOTCONN)
        all_of_it = bool(flags & getattr(socket, "MSG_WAITALL", 0)) and self.gettimeout() != 0
        wanted = min(size, ROOM) if all_of_it else min(size, 1)
        self._wait(lambda: len(pipe.data) >= wanted or pipe.ended, "recv")
        data = bytes(pipe.data[:size])
        if not flags & socket.MSG_PEEK:
            del pipe.data[: len(data)]
        return data

    def recvfrom(self, size: int, flags: int = 0, /) -> tuple[bytes, Any]:
        if self.type != socket.SOCK_DGRAM:
            return self.recv(size, flags), None
        self._check_open()
        self._wait(lambda: bool(self._datagrams) or self.fileno() < 0, "recvfrom")
        data, sender = self._datagrams[0] if flags & socket.MSG_PEEK else self._datagrams.popleft()
        return data[:size], sender

    def recv_into(self, buffer: Any, size: int = 0, flags: int = 0) -> int:
        with memoryview(buffer).cast("B") as view:
            data = self.recv(size or len(view), flags)
            view[: len(data)] = data
        return len(data)

    def recvfrom_into(self, buffer: Any, size: int = 0, flags: int = 0) -> tuple[int, Any]:
        with memoryview(buffer).cast("B") as view:
            data, sender = self.recvfrom(size or len(view), flags)
            view[: len(data)] = data
        return len(data), sender

    def send(self, data: Any, flags: int = 0, /) -> int:
        self._check_open()
        if self.type == socket.SOCK_DGRAM:
            if self._there is None:
                _error(errno.EDESTADDRREQ)
            return self.sendto(data, self._there)
        pipe = self._out
        if pipe is None:
            _error(errno.ENOTCONN)
        self._wait(lambda: len(pipe.data) < ROOM or pipe.ended, "send")
        if pipe.ended:  # by either side
            _error(errno.EPIPE)
        with memoryview(data).cast("B") as view:
            sent = bytes(view[: ROOM - len(pipe.data)])
        pipe.data += sent
        return len(sent)

    def sendall(self, data: Any, flags: int = 0, /) -> None:
        with memoryview(data).cast("B") as view:
            done = 0
            while done < len(view):
                done += self.send(view[done:], flags)

    def sendmsg(self, buffers: Iterable[Any], *_: Any) -> int:
        return self.send(b"".join(bytes(buffer) for buffer in buffers))

    def sendto(self, data: Any, *args: Any) -> int:
        """`sendto(data, [flags,] address)`."""
        key = self._key(args[-1])
        self._check_open()
        if key is None:
            _error(errno.ENETUNREACH)
        if self._here is None and self.family != _UNIX:
            self.bind(("0.0.0.0", 0))
        self._turns().free_look()
        receiver = self._network.bound.get(key)
        sent = bytes(data)
        if receiver is not None:  # one to nobody is lost, as in a network
            sender = self._here if self._here is None or self.family == _UNIX else ("127.0.0.1", self._here[1])
            receiver._datagrams.append((sent, sender))
        return len(sent)


def _join(one: VirtualSocket, other: VirtualSocket) -> None:
    one._in = other._out = _Pipe()
    one._out = other._in = _Pipe()


def _pair(_: Turns, family: int | None = None, type: int = socket.SOCK_STREAM, proto: int = 0) -> tuple[Any, Any]:
    family = family if family is not None else socket.AF_INET if _UNIX is None else _UNIX
    one, other = (VirtualSocket(family, type, proto) for _ in range(2))
    _join(one, other)
    one._there = other._there = "" if family == _UNIX else ("127.0.0.1", 0)
    return one, other


# Names


def _numeric(host: Any) -> Any:
    """A host as a number, without asking anybody; other names end the host."""
    host = host.decode() if isinstance(host, bytes) else host
    if host in (None, *_ANY) or ":" in host or host.replace(".", "").isdecimal():
        return host
    if _is_local(host):
        return "127.0.0.1"
    refuse(f"the address of {host}, another computer,", SERVE)


_address_info = socket.getaddrinfo


def _getaddrinfo(_: Turns, host: Any, port: Any, family: int = 0, *args: Any, **kwargs: Any) -> Any:
    number = "::1" if host == "localhost" and family == socket.AF_INET6 else _numeric(host)
    return _address_info(number, port, family, *args, **kwargs)


def _gethostbyaddr(_: Turns, host: str) -> tuple[str, list[str], list[str]]:
    if not _is_local(host):
        raise socket.herror(1, "Unknown host")
    return "localhost", [], ["127.0.0.1"]


def stand_ins() -> list[tuple[Any, Any]]:
    """Pairs of real functions of `socket`, and their stand-ins."""
    by_name: dict[str, Callable[..., Any]] = {
        "socketpair": _pair,
        "getaddrinfo": _getaddrinfo,
        "gethostbyname": lambda _, host: _numeric(host) or "0.0.0.0",
        "gethostbyname_ex": lambda _, host: (host, [], [_numeric(host)]),
        "gethostbyaddr": _gethostbyaddr,
    }
    pairs = [(getattr(socket, name), virtual) for name, virtual in by_name.items()]
    return [(Real, VirtualSocket), *((real, StandIn(real, virtual)) for real, virtual in pairs)]
