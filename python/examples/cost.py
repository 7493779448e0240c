"""Cost of calls from Python on this machine: the best of seven runs each."""

import time
from collections.abc import Callable

import numpy as np
import springpot as sp

model = sp.load("preset:table3-n2")
time_s = np.arange(15_501) / 100
recording = sp.Recording(time_s, voltage_v=3000 * (1 - np.cos(time_s)), displacement_m=np.zeros_like(time_s))
state, tracking, observer = sp.Law(model, 1000).at_rest(), sp.Tracking(model, 1000), sp.Observer(model, 1000)
forces = np.linspace(0, 100, 155_000)


def print_best(what: str, run: Callable[[], object], calls: int, unit: str, scale: float) -> None:
    """The shortest of seven runs over ``calls``."""
    seconds = []
    for _ in range(7):
        begun = time.perf_counter()
        run()
        seconds.append(time.perf_counter() - begun)
    print(f"{what:44}{scale * min(seconds) / calls:8.2f} {unit}")


print_best("a step of the law, along an array", lambda: state.displacement(forces), len(forces), "ns", 1e9)
print_best("a step of the law, one by one", lambda: [state.displacement(1.0) for _ in range(10_000)], 10_000, "µs", 1e6)
print_best("a tick of the observer", lambda: [observer.tick(1e3, 1e-3) for _ in range(10_000)], 10_000, "µs", 1e6)
print_best("a tick of tracking", lambda: [tracking.tick(1e-3, 1e-3) for _ in range(10_000)], 10_000, "µs", 1e6)
print_best("simulate, 155 s at 1 kHz", lambda: sp.simulate(model, recording), 1, "ms", 1e3)
