"""A reference followed through an amplifier with an analogue input, by an analogue output of a device of NI.

`pip install springpot nidaqmx`, and NI's driver. Tested against a stand-in of `nidaqmx`; it was not tried on a device.
"""

import time
from contextlib import nullcontext

import nidaqmx
import numpy as np
import numpy.typing as npt
import springpot as sp
from nidaqmx.constants import WatchdogAOExpirState
from nidaqmx.errors import DaqError
from nidaqmx.system.watchdog import WatchdogTask
from nidaqmx.types import AOExpirationState

# The device's own watchdog brings 0 V after this time without a set-point, s.
WATCHDOG_S = 0.25
# Time by which a set-point may be late, and for which the monitor may contradict the commands, s.
LATE_S, LIE_S = 0.1, 0.3
# The monitor's error: V, and a share of the voltage.
BAND_V, BAND_SHARE = 30.0, 0.02


class Stopped(RuntimeError):
    """The run has ended at a command of 0 V before its time."""


def watchdog(device: str) -> WatchdogTask | None:
    """The device's watchdog, which sets the output to 0 V; None for a device that has none."""
    try:
        dog = WatchdogTask(device, timeout=WATCHDOG_S)
    except DaqError:
        return None
    dog.cfg_watchdog_ao_expir_states([AOExpirationState(f"{device}/ao0", 0.0, WatchdogAOExpirState.VOLTAGE)])
    dog.start()
    return dog


def follow(
    model: sp.Model,
    reference_m: npt.NDArray[np.float64],
    *,
    device: str = "Dev1",
    rate_hz: float = 100.0,
    gain: float = 1000.0,
    max_voltage_v: float = 3000.0,
    without_watchdog: bool = False,
) -> npt.NDArray[np.float64]:
    """Plays `reference_m` (m, `rate_hz` values per second) by ao0 and reads the amplifier's monitor at ai0.

    Both have 1 V for `gain` V at the film. Returns the monitor (V). Whatever ends it, 0 V is the last command.
    """
    controller = sp.Feedforward(model, rate_hz, limits={"max_voltage_v": max_voltage_v})
    monitor = np.full(len(reference_m), np.nan)
    dog = watchdog(device)
    if dog is None and not without_watchdog:
        raise Stopped(f"{device} has no watchdog: its output keeps its voltage if this program is killed; without_watchdog=True accepts that")
    with nidaqmx.Task() as output, nidaqmx.Task() as reading, dog or nullcontext():
        output.ao_channels.add_ao_voltage_chan(f"{device}/ao0", min_val=0.0, max_val=10.0)
        reading.ai_channels.add_ai_voltage_chan(f"{device}/ai0", min_val=-10.0, max_val=10.0)
        begun, good_s, command_v, before_v = time.monotonic(), 0.0, 0.0, 0.0
        try:
            for k, target in enumerate(reference_m):
                due_s, now_s = k / rate_hz, time.monotonic() - begun
                if now_s > due_s + LATE_S:
                    raise Stopped(f"this computer was busy for {now_s - due_s:.2f} s")
                time.sleep(max(due_s - now_s, 0.0))
                monitor[k] = gain * float(reading.read())
                low, high = sorted((before_v, command_v))
                band = BAND_V + BAND_SHARE * high
                if low - band <= monitor[k] <= high + band:
                    good_s = due_s
                elif due_s - good_s > LIE_S or not monitor[k] < 1.1 * max_voltage_v:
                    raise Stopped(f"the monitor reads {monitor[k]:.0f} V at a command of {command_v:.0f} V")
                before_v, command_v = command_v, controller.tick(target).voltage_v
                output.write(command_v / gain)
                if dog is not None:
                    dog.reset_timer()
        finally:
            output.write(0.0)
    return monitor


if __name__ == "__main__":
    sine = sp.reference("sine", low_m=0.2e-3, high_m=0.6e-3, period_s=10, duration_s=30, rate_hz=100)
    assert sine.displacement_m is not None
    print(f"{follow(sp.load('film.toml'), sine.displacement_m).max():.0f} V")
