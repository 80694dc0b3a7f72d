"""The monitor: what is told of the line, what is kept for who looks later, what is lost."""

from __future__ import annotations

from isel_twin.bridge.operate.panel.monitor import LINES, PIECES, Monitor


def begun() -> Monitor:
    monitor = Monitor()
    monitor.begin("imc-s8")
    return monitor


def test_messages_are_explained_when_somebody_looks():
    monitor = begun()
    monitor.carry(1_000_000, b"@0", True)
    assert monitor.lines() == []
    monitor.carry(2_000_000, b"P\r", True)
    monitor.act(3_000_000, '{"set": {"estop": "pressed"}}')
    (host, other) = monitor.lines()
    assert (host["who"], host["text"], host["s"]) == ("host", "@0P", 0.002)
    assert host["means"]
    assert other == {"s": 0.003, "who": "ctl", "text": '{"set": {"estop": "pressed"}}', "means": ""}
    assert monitor.lines() == []


def test_memory_is_bounded_and_what_is_lost_is_told():
    monitor = begun()
    for number in range(PIECES + 10):
        monitor.carry(number, b"@0P\r", True)
    lines = monitor.lines()
    assert len(lines) == LINES + 1
    assert lines[0]["means"] == f"{10 + PIECES - LINES} messages before are not shown"
    assert all(line["text"] == "@0P" for line in lines[1:])


def test_a_message_whose_beginning_is_lost_does_not_spoil_the_next_ones():
    monitor = begun()
    monitor.carry(0, b"@0", True)
    monitor.lines()
    for _ in range(PIECES + 1):
        monitor.carry(1, b"@0P\r", True)
    assert {line["text"] for line in monitor.lines()[1:]} == {"@0P"}


def test_after_a_loss_a_message_that_had_begun_is_not_gone_on_with():
    command = b"@0A 1000,1000,1000,1000,1000,1000,1000,1000"
    monitor = begun()
    monitor.carry(0, b"@0", True)
    monitor.lines()
    monitor.carry(1, b"P\r", True)  # lost
    for number in range(PIECES):
        monitor.carry(2, (command + b"\r")[number % (len(command) + 1) :][:1], True)
    lost, *lines = monitor.lines()
    assert lost["means"] == "1 messages before are not shown"
    assert {line["text"] for line in lines} == {command.decode()}
    assert len(lines) == PIECES // (len(command) + 1)


def test_without_a_language_bytes_are_shown_after_a_silence():
    monitor = Monitor()
    monitor.carry(0, b"\x01\x02", True)
    monitor.look(1_000_000)
    assert monitor.lines() == []
    monitor.look(1_000_000_000)
    assert [line["text"] for line in monitor.lines()] == ["01 02"]
