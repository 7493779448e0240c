"""The film as its own sensor."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import springpot as sp

# x = 0.03 m of C / 700 pF − 1, and 100 pF of them are the cable's.
REST_F, SLOPE_M = 700e-12, 0.03
RELATION = f"""
[relation]
rest_f = {REST_F}
max_f = 900e-12
stroke_m = [{SLOPE_M}, 0.0, 0.0]
creep = 0.0
alpha = 0.2
uncertainty_m = 20e-6

[options]
step_s = 1e-3
tone_v = 50.0
periods = 5
voltage_noise_v = 0.2
current_noise_a = 15e-9
max_current_a = 0.2e-3
cable_f = 100e-12
drift_s = 600.0
"""


class Circuit:
    """An ideal amplifier and capacitor: the current is what has charged it."""

    def __init__(self) -> None:
        self.charge_c = self.voltage_v = self.current_a = 0.0

    def step(self, voltage_v: float, displacement_m: float) -> None:
        """A tick at whose end the film is so far."""
        before_c, self.charge_c = self.charge_c, REST_F * (1 + displacement_m / SLOPE_M) * voltage_v
        self.voltage_v, self.current_a = voltage_v, (self.charge_c - before_c) / 1e-3


@pytest.fixture
def sensing(tmp_path: Path) -> sp.SelfSensing:
    path = tmp_path / "c.toml"
    path.write_text(RELATION)
    return sp.SelfSensing(path)


def held(sensing: sp.SelfSensing, circuit: Circuit, displacement_m: float, ticks: int, gain: float = 1.0) -> list[sp.SelfSensed]:
    """Samples of a film that is held, behind a current monitor of this gain."""
    samples = []
    for _ in range(ticks):
        sensed = sensing.tick(circuit.voltage_v, gain * circuit.current_a)
        circuit.step(sensing.drive(3000.0), displacement_m)
        samples += [sensed] if sensed else []
    return samples


def test_a_capacitor_is_its_displacement(sensing: sp.SelfSensing) -> None:
    assert (sensing.rate_hz, sensing.tone_v, sensing.sensor_rate_hz) == (1000.0, 50.0, 50.0)
    assert sensing.sensor_delay_s == pytest.approx(0.014)
    circuit = Circuit()
    samples = held(sensing, circuit, 2e-3, 400)
    assert len(samples) == 18 and sensing.fault is None
    last = samples[-1]
    assert last.displacement_m == pytest.approx(2e-3, abs=1e-6) and last.age_s == sensing.sensor_delay_s
    assert last.capacitance_f == pytest.approx(REST_F * (1 + 2e-3 / SLOPE_M), rel=1e-4)
    assert 20e-6 < last.uncertainty_m < 60e-6
    # Another sensor, which is right.
    for _ in range(20):
        sensing.correct(2.1e-3, 1e-6)
        last = held(sensing, circuit, 2e-3, 40)[-1]
    assert last.displacement_m == pytest.approx(2.1e-3, abs=5e-6)


@pytest.mark.parametrize(("gain", "fault"), [(0.0, "current-monitor"), (0.2, "electrode"), (4.0, "shorted")])
def test_what_breaks_is_named(sensing: sp.SelfSensing, gain: float, fault: str) -> None:
    circuit = Circuit()
    assert held(sensing, circuit, 1e-3, 100) and sensing.fault is None
    held(sensing, circuit, 1e-3, 100, gain)
    assert sensing.fault == fault


def test_no_tone_is_named(sensing: sp.SelfSensing) -> None:
    for _ in range(100):
        sensing.tick(3000.0, 0.0)
    assert sensing.fault == "no-tone"


def test_a_film_is_tracked_by_itself(sensing: sp.SelfSensing) -> None:
    """Without another sensor, behind a rough model: within 1 % of the stroke, feedforward far off."""
    recording = sp.record_film(frequency_hz=[0.2], duration_s=30, rate_hz=50)
    model = sp.fit(recording, branches=0, topology="parallel", curve="none", hold=["offset_m"]).model
    sine = sp.reference("sine", low_m=1.5e-3, high_m=2.5e-3, period_s=10, duration_s=30, rate_hz=1000).displacement_m
    assert sine is not None
    rms = {}
    for alone in (True, False):
        film, circuit = sp.SimulatedFilm(), Circuit()
        tracking = sp.Tracking(
            model, 1000, bandwidth_hz=0.6, sensor_rate_hz=sensing.sensor_rate_hz, sensor_delay_s=sensing.sensor_delay_s
        )
        reached = [film.displacement_m]
        for target in sine[1:]:
            sensed = sensing.tick(circuit.voltage_v, circuit.current_a) if alone else None
            tick = tracking.tick(target, sensed and sensed.displacement_m, age_s=sensed.age_s if sensed else None)
            voltage_v = sensing.drive(tick.voltage_v)
            reached.append(film.advance(voltage_v, 1e-3))
            circuit.step(voltage_v, reached[-1])
        rms[alone] = float(np.sqrt(np.mean((np.array(reached) - sine)[10_000:] ** 2)))
    assert rms[True] < 10e-6 and rms[False] > 5 * rms[True], rms


def test_what_is_refused(sensing: sp.SelfSensing, tmp_path: Path) -> None:
    with pytest.raises(sp.InputError, match="voltage_v"):
        sensing.drive(math.nan)
    for arguments in ((math.nan, 1e-6), (1e-3, 0.0), (1e-3, math.inf)):
        with pytest.raises(sp.InputError):
            sensing.correct(*arguments)
    with pytest.raises(sp.InputError, match="age_s"):
        sensing.correct(1e-3, 1e-6, age_s=-1.0)
    other = tmp_path / "other.toml"
    for text in ("", "x = 1", RELATION.replace("periods = 5", "periods = 1"), RELATION.replace("900e-12", "nan")):
        other.write_text(text)
        with pytest.raises(sp.FileError, match="other.toml"):
            sp.SelfSensing(other)
    with pytest.raises(sp.FileError, match="none.toml"):
        sp.SelfSensing(tmp_path / "none.toml")
