"""The example with an analogue output, on a stand-in that has the signatures of the installed `nidaqmx`."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import Any
from unittest.mock import create_autospec

import nidaqmx
import nidaqmx.system.watchdog
import numpy as np
import pytest
import springpot as sp
from nidaqmx.errors import DaqError
from nidaqmx.task.collections import AIChannelCollection, AOChannelCollection

from conftest import ROOT

sys.path.insert(0, str(ROOT / "python" / "examples"))
import analogue_output

GAIN = 1000.0
# The class itself, which a test replaces.
TASK = nidaqmx.Task
MODEL = sp.load("preset:table3-n2")
SINE = sp.reference("sine", low_m=0.3e-3, high_m=0.8e-3, period_s=4, duration_s=6, rate_hz=100).displacement_m


class Device:
    """An amplifier that follows at once, and a clock that only waiting advances."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now_s, self.volts, self.timer_s = 0.0, 0.0, 0.0
        self.played: list[float] = []
        self.channels: list[str] = []
        self.share: Callable[[], float] = lambda: 1.0
        self.has_watchdog = True
        self.interrupt_s = np.inf
        self.dog = create_autospec(nidaqmx.system.watchdog.WatchdogTask, instance=True)
        self.dog.reset_timer.side_effect = self.reset
        # Lookups of these are in the class.
        self.dog.__enter__ = lambda _: self.dog
        self.dog.__exit__ = lambda *_: None
        monkeypatch.setattr(nidaqmx, "Task", self.task)
        monkeypatch.setattr(analogue_output, "WatchdogTask", self.watchdog)
        monkeypatch.setattr(time, "monotonic", lambda: self.now_s)
        monkeypatch.setattr(time, "sleep", self.sleep)

    def task(self) -> Any:
        task = create_autospec(TASK, instance=True)
        for name, kind in (("ao_channels", AOChannelCollection), ("ai_channels", AIChannelCollection)):
            setattr(task, name, create_autospec(kind, instance=True))
        task.ao_channels.add_ao_voltage_chan.side_effect = lambda channel, **_: self.channels.append(channel)
        task.ai_channels.add_ai_voltage_chan.side_effect = lambda channel, **_: self.channels.append(channel)
        task.write.side_effect = self.write
        task.read.side_effect = lambda: self.share() * self.volts
        task.__enter__ = lambda _: task
        task.__exit__ = lambda *_: None
        return task

    def watchdog(self, device: str, timeout: float) -> Any:
        if not self.has_watchdog:
            raise DaqError("not supported", -200077)
        return self.dog

    def write(self, volts: float) -> None:
        assert 0.0 <= volts <= 10.0
        self.volts = volts
        self.played.append(GAIN * volts)

    def reset(self) -> None:
        assert self.now_s - self.timer_s < analogue_output.WATCHDOG_S
        self.timer_s = self.now_s

    def sleep(self, seconds: float) -> None:
        if self.now_s > self.interrupt_s:
            raise KeyboardInterrupt
        self.now_s += seconds


def test_a_sine_is_played(monkeypatch: pytest.MonkeyPatch) -> None:
    """The voltage is that of feedforward in the tool's own loop, tick by tick, and 0 V at the end."""
    device = Device(monkeypatch)
    assert SINE is not None
    monitor = analogue_output.follow(MODEL, SINE)
    assert device.channels == ["Dev1/ao0", "Dev1/ai0"]
    controller = sp.Feedforward(MODEL, 100, limits={"max_voltage_v": 3000.0})
    expected = [controller.tick(target).voltage_v for target in SINE]
    assert device.played == [pytest.approx(volts) for volts in expected] + [0.0]
    assert max(expected) > 1000 and monitor[1:] == pytest.approx(expected[:-1])
    [states] = device.dog.cfg_watchdog_ao_expir_states.call_args.args
    assert (states[0].physical_channel, states[0].expiration_state) == ("Dev1/ao0", 0.0)
    assert device.dog.reset_timer.call_count == len(SINE)


@pytest.mark.parametrize("share", [0.9, 1.1, -1.0, np.nan])
def test_a_monitor_that_lies_ends_the_run(monkeypatch: pytest.MonkeyPatch, share: float) -> None:
    device = Device(monkeypatch)
    device.share = lambda: share if device.now_s > 3 else 1.0
    assert SINE is not None
    with pytest.raises(analogue_output.Stopped, match="monitor reads"):
        analogue_output.follow(MODEL, SINE)
    assert device.now_s < 3.5 and device.played[-1] == 0.0 and max(device.played) > 1000


def test_every_end_is_at_0_v(monkeypatch: pytest.MonkeyPatch) -> None:
    device = Device(monkeypatch)
    device.interrupt_s = 3.0
    assert SINE is not None
    with pytest.raises(KeyboardInterrupt):
        analogue_output.follow(MODEL, SINE)
    assert device.played[-1] == 0.0 and device.played[-2] > 500


def test_a_device_without_a_watchdog_must_be_accepted(monkeypatch: pytest.MonkeyPatch) -> None:
    device = Device(monkeypatch)
    device.has_watchdog = False
    assert SINE is not None
    with pytest.raises(analogue_output.Stopped, match="no watchdog"):
        analogue_output.follow(MODEL, SINE)
    assert device.played == []
    assert len(analogue_output.follow(MODEL, SINE[:50], without_watchdog=True)) == 50
