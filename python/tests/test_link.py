"""A conversation with a board that runs in a process of its own: the driver's code around a simulated bench."""

from __future__ import annotations

import os
import subprocess
import threading
import time
from collections.abc import Iterator
from typing import Any

import pytest
import springpot as sp

from conftest import ROOT, Tool


@pytest.fixture
def port() -> Iterator[str]:
    program = os.environ.get("SPRINGPOT_VIRTUAL_BOARD", str(ROOT / "target" / "debug" / "virtual-board-on-host"))
    with subprocess.Popen([program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as board:
        assert board.stdin is not None and board.stdout is not None
        yield board.stdout.readline().strip()
        board.stdin.close()


def upload(link: sp.Link) -> None:
    """Parameters, until the next reset; a board reads its interlock for some ticks before it may be armed."""
    link.upload(sp.load("preset:table3-n2"), bench=True, keep=False)
    begun = link.status()["ticks"]
    while link.status()["ticks"] < begun + 200:
        time.sleep(0.01)


def test_a_run(port: str, tool: Tool) -> None:
    """Parameters, a run and its end; what the command reports of the board is what the package does."""
    with sp.Link(port) as link:
        assert link.identify()["parameters"] is None and link.status()["rate_hz"] == 0
        upload(link)
        known, state = link.identify(), link.status()
        assert (state["state"], state["rate_hz"]) == ("disarmed", 1000)
        link.arm()
        link.start("voltage")
        link.stream(10)
        begun, records = time.monotonic(), []
        while time.monotonic() - begun < 1.0:
            link.set_voltage(1000.0)
            records += link.samples(0.05)
        assert link.status()["command_v"] == pytest.approx(1000, abs=1)
        assert len(records) > 20 and records[-1]["monitor_v"] == pytest.approx(1000, abs=10)
        assert {"tick", "displacement_m", "predicted_m", "reference_m"} < set(records[0])
        link.stream(0)
        link.stop()
        assert link.status()["state"] == "armed"
    # Disarmed by the end of the block.
    reported = tool.json("link", "--port", port, "identify")
    assert {key: reported[key] for key in known} == known
    assert "disarmed" in tool.run("link", "--port", port, "status").stdout


def test_every_end_disarms(port: str) -> None:
    with pytest.raises(ZeroDivisionError), sp.Link(port) as link:
        upload(link)
        link.arm()
        raise ZeroDivisionError
    with sp.Link(port) as link:
        assert link.status()["state"] == "disarmed"


def test_threads_take_turns_on_a_link(port: str) -> None:
    """Eight threads ask on one line: each gets its own answer."""
    answers: list[Any] = []
    with sp.Link(port) as link:
        threads = [threading.Thread(target=lambda: answers.extend(link.identify() for _ in range(20))) for _ in range(8)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert len(answers) == 160 and all(answer == link.identify() for answer in answers)


def test_refusals(port: str) -> None:
    with sp.Link(port) as link:
        with pytest.raises(sp.LinkError, match="there are no parameters yet"):
            link.arm()
        with pytest.raises(sp.Error, match="bench"):
            link.upload(sp.load("preset:table3-n2"))
        for call, name in (
            (lambda: link.set_voltage(float("nan")), "voltage_v"),
            (lambda: link.set_voltage("high"), "voltage_v"),  # type: ignore[arg-type]
            (lambda: link.set_reference(float("inf")), "reference_m"),
            (lambda: link.start("fast"), "mode"),  # type: ignore[arg-type]
            (lambda: link.stream(-1), "every"),
            (lambda: link.stream(1.5), "every"),  # type: ignore[arg-type]
            (lambda: link.samples(-1), "duration_s"),
            (lambda: link.upload(sp.load("preset:table3-n2"), bench=True, rate_hz=0), "rate_hz"),
        ):
            with pytest.raises((TypeError, ValueError), match=name):
                call()
    with pytest.raises(sp.LinkError, match="no-such-port"):
        sp.Link("no-such-port")
