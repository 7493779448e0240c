"""Long calls: other threads run meanwhile, Ctrl-C ends them, progress is reported. Nothing here depends on how long anything takes."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
import springpot as sp

# After this long something hangs.
DEADLINE_S = 300


def test_progress_is_told(films: list[Path]) -> None:
    stages: list[sp.Stage] = []
    caller = threading.get_ident()

    def progress(stage: sp.Stage) -> None:
        assert threading.get_ident() == caller
        stages.append(stage)

    result = sp.fit(films, branches=1, topology="parallel", curve="none", progress=progress)
    assert not result.interrupted and result.parameters
    assert [stage.what for stage in stages][-1] == "fits to parts of the recordings"
    shares = [stage.share for stage in stages if stage.share is not None]
    assert shares == sorted(shares) and all(0 <= share <= 1 for share in shares)


def test_false_ends_a_fit_with_the_best_so_far(films: list[Path]) -> None:
    result = sp.fit(films, topology="parallel", starts=200, progress=lambda stage: stage.number is None or stage.number < 3)
    assert result.interrupted and not result.parameters
    assert result.r2_mean > 0.9
    assert "interrupted = true" in result.model.to_toml()


def test_what_progress_raises_is_raised(films: list[Path]) -> None:
    def progress(stage: sp.Stage) -> None:
        raise LookupError(stage.what)

    with pytest.raises(LookupError):
        sp.fit(films, starts=200, progress=progress)


def test_other_threads_run_during_a_fit(films: list[Path]) -> None:
    """The fit ends early only if the other thread was served while it went on."""
    begun, served = threading.Event(), threading.Event()
    results: list[sp.FitResult] = []

    def progress(stage: sp.Stage) -> bool:
        begun.set()
        return not served.is_set()

    def run() -> None:
        results.append(sp.fit(films, starts=200, progress=progress))

    thread = threading.Thread(target=run)
    thread.start()
    assert begun.wait(DEADLINE_S)
    state = sp.Law(sp.load("preset:table3-n2"), 1000).at_rest()
    for _ in range(1000):
        state.displacement(1.0)
    served.set()
    thread.join(DEADLINE_S)
    assert results and results[0].interrupted


def test_the_lock_is_released_within_a_call() -> None:
    """Ten looks from another thread fall into one call: with the lock held there would be two at the most, at its ends."""
    model = sp.load("preset:table3-n2")
    recording = sp.Recording([0.0, 200.0], voltage_v=[0.0, 3000.0])
    call, ended = 0, threading.Event()

    def run() -> None:
        nonlocal call
        while not ended.is_set():
            call += 1
            sp.simulate(model, recording, rate_hz=10_000)

    thread = threading.Thread(target=run)
    thread.start()
    deadline = time.monotonic() + DEADLINE_S
    looks, seen = 0, 0
    while looks < 10 and time.monotonic() < deadline:
        time.sleep(1e-3)
        looks, seen = (looks + 1, seen) if call == seen and call > 0 else (0, call)
    ended.set()
    thread.join(DEADLINE_S)
    assert looks == 10


def test_calls_do_not_disturb_each_other(films: list[Path]) -> None:
    """Four threads at once: the bits of one alone."""
    model = sp.load("preset:table3-n2")
    expected = sp.simulate(model, films[0]).displacement_m
    results: dict[int, sp.Response] = {}
    threads = [threading.Thread(target=lambda k=k: results.update({k: sp.simulate(model, films[0])})) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(DEADLINE_S)
    assert len(results) == 4
    assert all(np.array_equal(response.displacement_m, expected) for response in results.values())


class Alarm(Exception):
    """An exception that the handler of a signal raises."""


CALLS = {
    "simulate": "sp.simulate(model, ramp, rate_hz=50_000)",
    "simulate in full": "sp.simulate(model, ramp, rate_hz=2_000, memory='full')",
    "replay": "sp.replay(model, [ramp] * 4, rate_hz=50_000)",
    "feedforward": "sp.feedforward(model, ramp, rate_hz=50_000)",
    "observe": "sp.observe(model, film, rate_hz=200_000)",
    "fit": "sp.fit(film, starts=2_000)",
}


@pytest.mark.parametrize("name", CALLS)
def test_signals_are_heard_within_calls(name: str) -> None:
    """A handler that raises does so from within the call."""
    scope = {
        "sp": sp,
        "model": sp.load("preset:table3-n2"),
        "ramp": sp.Recording([0.0, 100.0, 200.0], voltage_v=[0.0, 1e3, 2e3], displacement_m=[0.0, 1e-3, 2e-3]),
        "film": sp.record_film(frequency_hz=[0.2], duration_s=20, rate_hz=50),
    }
    within = threading.Event()
    call = compile(CALLS[name], "call", "eval")

    def handler(number: int, frame: object) -> None:
        # Only what is raised while the native part works is wanted: the one line of Python there is the call.
        code = getattr(frame, "f_code", None)
        if code is not None and code.co_filename == "call":
            within.set()
            raise Alarm

    before = signal.signal(signal.SIGALRM, handler)
    signal.setitimer(signal.ITIMER_REAL, 0.2, 0.2)
    try:
        with pytest.raises(Alarm):
            deadline = time.monotonic() + DEADLINE_S
            while time.monotonic() < deadline:
                eval(call, scope)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert within.is_set()


def test_a_state_stays_where_it_was_interrupted() -> None:
    law = sp.Law(sp.load("preset:table3-n2"), 1000)
    state, other = law.at_rest(), law.at_rest()
    state.displacement(10.0)
    other.displacement(10.0)

    def handler(number: int, frame: object) -> None:
        raise Alarm

    before = signal.signal(signal.SIGALRM, handler)
    forces = np.full(20_000_000, 20.0)
    signal.setitimer(signal.ITIMER_REAL, 0.1)
    try:
        with pytest.raises(Alarm):
            state.displacement(forces)
            # So fast a machine does not get here; one that does has the alarm yet to come.
            time.sleep(DEADLINE_S)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert state.displacement(5.0) == other.displacement(5.0)


def test_ctrl_c_ends_a_fit(films: list[Path]) -> None:
    program = (
        "import springpot as sp\n"
        "try:\n"
        f"    sp.fit({str(films[0])!r}, starts=50_000, progress=lambda stage: print(stage.what, flush=True))\n"
        "except KeyboardInterrupt:\n"
        "    print('handled', flush=True)\n"
    )
    child = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True)
    try:
        assert child.stdout is not None and child.stdout.readline()
        child.send_signal(signal.SIGINT)
        rest, _ = child.communicate(timeout=DEADLINE_S)
    finally:
        child.kill()
    assert rest.splitlines()[-1] == "handled"
    assert child.returncode == 0
