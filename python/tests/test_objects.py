"""Actuators, models, laws and their states."""

from __future__ import annotations

import copy
import math
import pickle
import re
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import springpot as sp


def test_eq_1() -> None:
    """F = ε0 εr (V / l3)² l1 l2 at 6 kV, by hand: 140 N."""
    actuator = sp.Actuator()
    by_hand = 8.8541878128e-12 * 4.7 * (6000 / 160e-6) ** 2 * 0.04 * 0.06
    assert actuator.force(6000.0) == pytest.approx(by_hand, rel=1e-12)
    volts = np.array([0.0, 3000.0, 6000.0])
    assert actuator.force(volts) == pytest.approx([0, by_hand / 4, by_hand], rel=1e-12)
    assert actuator.voltage(actuator.force(volts)) == pytest.approx(volts, rel=1e-12)
    # The weight from t = 0.
    hung = sp.Actuator(preload="from-start")
    assert hung.force(0.0) == pytest.approx(0.316 * 9.80665, rel=1e-12)
    assert sp.Actuator(saturation_v=6000).force(6000.0) == pytest.approx(by_hand / 2, rel=1e-12)
    assert sp.Actuator(stretch_coupling=10).force(6000.0, 0.01) == pytest.approx(1.1 * by_hand, rel=1e-12)


def test_a_springpot_creeps_as_a_power() -> None:
    """One springpot: J(t) = t^α / (c Γ(1 + α)), G(t) = c t^−α / Γ(1 − α)."""
    model = sp.Model((60e3, 0.2))
    time = np.array([0.1, 1.0, 100.0])
    assert model.creep_compliance(time) == pytest.approx(time**0.2 / (60e3 * math.gamma(1.2)), rel=1e-10)
    assert model.relaxation_modulus(1.0) == pytest.approx(60e3 / math.gamma(0.8), rel=1e-10)
    assert math.isnan(model.creep_compliance(0.0))


def test_a_film_at_another_temperature() -> None:
    """Creep is k times less, and a times as fast: k = 1 − 0.01 · 10, a = exp(E/R (1/T − 1/T₀))."""
    table = "[temperature]\nreference_c = 20.0\nstiffness_per_k = -0.01\nactivation_kj_per_mol = 50.0\n"
    text = sp.Model((60e3, 0.2)).to_toml().replace("schema = 1", "schema = 5")
    model = sp.Model.from_toml(text + table)
    warm = model.at_temperature(30.0)
    time = math.exp(50e3 / 8.314462618 * (1 / 303.15 - 1 / 293.15))
    assert (model.reference_c, warm.reference_c, sp.Model((60e3, 0.2)).reference_c) == (20.0, 30.0, None)
    assert warm.creep_compliance(time) == pytest.approx(model.creep_compliance(1.0) / 0.9, rel=1e-10)
    with pytest.raises(sp.InputError, match="no .temperature. table"):
        sp.Model((60e3, 0.2)).at_temperature(30.0)
    recording = sp.Recording([0.0, 1.0], voltage_v=[0.0, 1.0], temperature_c=[20.0, 22.0])
    assert recording.temperature_c == pytest.approx([20.0, 22.0])


def test_tracking_follows_a_stated_temperature() -> None:
    """A film 10 K warmer, a tenth softer: without a sensor the voltage becomes that of its model at 30 °C."""
    table = "[temperature]\nreference_c = 20.0\nstiffness_per_k = -0.01\nactivation_kj_per_mol = 50.0\n"
    text = sp.Model((60e3, 0.1)).to_toml().replace("schema = 1", "schema = 5")
    model = sp.Model.from_toml(text + table)
    sine = sp.reference("sine", low_m=0.3e-3, high_m=0.6e-3, period_s=10, duration_s=60, rate_hz=100).displacement_m
    assert sine is not None
    voltages = []
    for law, temperature_c in ((model, None), (model, 30.0), (model.at_temperature(30.0), None)):
        tracking = sp.Tracking(law, 100)
        if temperature_c is not None:
            tracking.set_temperature(temperature_c)
        voltages.append(np.array([tracking.tick(target).voltage_v for target in sine])[3000:])
    [cold, stated, warm] = voltages
    # Modes faster than 2/s keep their rates.
    assert np.max(np.abs(stated / warm - 1)) < 0.02 < 0.08 < np.min(np.abs(cold / warm - 1))
    tracking = sp.Tracking(model, 100)
    tracking.set_temperature(30.0)
    assert tracking.tick(0.3e-3).ageing is None
    for temperature_c, cause in ((300.0, "K or °F"), (70.0, "run its parameters at that temperature"), (math.nan, "NaN")):
        with pytest.raises(sp.InputError, match=f"temperature_c.*{cause}"):
            tracking.set_temperature(temperature_c)
    with pytest.raises(sp.InputError, match="no .temperature. table"):
        sp.Tracking(sp.Model((60e3, 0.1)), 100).set_temperature(30.0)


def test_a_law_is_its_defining_sum() -> None:
    """Grünwald–Letnikov by its weights: a springpot in f64 against Σ w_j x_{k−j} / h^α."""
    alpha, c, step = 0.3, 50e3, 1e-2
    law = sp.Law(sp.Model((c, alpha), actuator=sp.Actuator(mass_kg=0)), 100, precision="f64")
    weights = np.cumprod(np.concatenate([[1.0], 1 - (alpha + 1) / np.arange(1, 400)]))
    x = 1e-3 * np.sin(np.arange(400) / 30) ** 2
    expected = c * np.convolve(weights, x)[:400] / step**alpha
    state = law.at_rest()
    force = state.force(x)
    # What the compression of the memory costs.
    assert force == pytest.approx(expected, abs=1e-7 * np.abs(expected).max())
    # And back.
    assert law.at_rest().displacement(force) == pytest.approx(x, abs=1e-9 * x.max())
    assert state.displacement_m == x[-1]


def test_a_step_is_a_step() -> None:
    """Sample by sample, in parts or along an array: the same bits; a copy goes its own way."""
    law = sp.Law(sp.load("preset:table3-n2"), 1000)
    force = 100 * np.sin(np.arange(2000) / 300) ** 2
    whole = law.at_rest().displacement(force)
    single, parts = law.at_rest(), law.at_rest()
    assert [single.displacement(float(f)) for f in force] == whole.tolist()
    assert np.concatenate([parts.displacement(force[:700]), parts.displacement(force[700:])]).tolist() == whole.tolist()
    fork = parts.copy()
    assert fork.displacement(50.0) == parts.displacement(50.0)
    fork.displacement(np.full(100, 200.0))
    assert fork.displacement_m > parts.displacement_m
    # In f32 as on the controller: every value is one of single precision.
    assert np.array_equal(whole.astype(np.float32).astype(np.float64), whole)


def test_a_law_settles() -> None:
    """Under a constant force: as that many steps."""
    law = sp.Law(sp.load("preset:table3-n2"), 100, precision="f64")
    stepped = law.at_rest()
    stepped.displacement(np.full(100_000, 10.0))
    # The law's settling has no inertia, and is equal to 1e-6.
    assert law.settled(10.0, 1000.0).displacement_m == pytest.approx(stepped.displacement_m, rel=1e-5)


def test_frequency_responses_agree() -> None:
    model = sp.load("preset:table3-n2")
    frequency = np.array([0.01, 0.1, 1.0])
    discrete = sp.Law(model, 1000).frequency_response(frequency)
    continuous = sp.frequency_response(model, 0.01, 1.0, 3)
    # First order at 1 kHz: α π f / rate at most.
    assert np.abs(discrete) == pytest.approx(continuous.magnitude_m_per_n, rel=5e-3)
    assert np.angle(discrete) == pytest.approx(continuous.phase_rad, abs=5e-3)
    assert isinstance(sp.Law(model, 1000).frequency_response(0.1), complex)


def test_models_go_through_files(tmp_path: Path) -> None:
    model = sp.Model(
        (62740.0, 0.2),
        [((47958.0, 1.0), (173210.0, 1.0)), ((430381.0, 0.523), (215.0, 0.046))],
        topology="eq11",
        actuator=sp.Actuator(thickness_m=100e-6, stretch_coupling=-1.5, saturation_v=9000),
        sensor_offset_m=2e-6,
        name="film é",
    )
    sp.save(model, tmp_path / "film.toml")
    again = sp.load(tmp_path / "film.toml")
    assert again.to_toml() == model.to_toml()
    for name in ("name", "topology", "main", "branches", "actuator", "sensor_offset_m", "curve", "spring", "sizes_assumed"):
        assert getattr(again, name) == getattr(model, name), name
    for other in (pickle.loads(pickle.dumps(model)), copy.deepcopy(model)):
        assert other.to_toml() == model.to_toml()
    presets = [sp.load(name) for name in sp.presets()]
    assert [len(preset.branches) for preset in presets] == [1, 2, 3, 4, 5, 2, 2, 2]


def test_curves_are_kept() -> None:
    """A film behind an elastic curve is read, run and written."""
    text = sp.load("preset:table3-n1").to_toml().replace("schema = 1", "schema = 2")
    text += '\n[curve]\nelastic = "mooney-rivlin"\nshare = 0.5\nfree_length_m = 0.05\nfrom_m = -0.002\nto_m = 0.02\n'
    model = sp.Model.from_toml(text)
    assert model.curve == "mooney-rivlin" and sp.Model.from_toml(model.to_toml()).to_toml() == model.to_toml()
    state = sp.Law(model, 1000).at_rest()
    state.force(0.05)
    assert state.beyond_curve


def test_a_spring_in_series_is_kept() -> None:
    """A film with a spring in series is read, run and written; under a force the spring adds to its creep."""
    text = sp.load("preset:table3-n1").to_toml()
    memory = sp.Model.from_toml(text)
    series = text.replace("schema = 1", "schema = 4") + "\n[spring]\nin_series = true\nstiffness_n_per_m = 90000.0\n"
    model = sp.Model.from_toml(series)
    assert (memory.spring, model.spring, model.curve) == (None, "in series", None)
    assert sp.Model.from_toml(model.to_toml()).to_toml() == model.to_toml()
    alone, film = (sp.Law(law, 1000).settled(9.0, 60.0) for law in (memory, model))
    assert film.displacement_m - alone.displacement_m == pytest.approx(9.0 / 90000.0, rel=1e-5)


def test_loops_follow() -> None:
    """A sine on the simulated film: tracking within 1 % of peak to peak, feedforward alone with the same rough model far off."""
    recording = sp.record_film(frequency_hz=[0.2], duration_s=30, rate_hz=50)
    model = sp.fit(recording, branches=0, topology="parallel", curve="none", hold=["offset_m"]).model
    sine = sp.reference("sine", low_m=1.5e-3, high_m=2.5e-3, period_s=10, duration_s=40, rate_hz=200).displacement_m
    assert sine is not None
    rms = {}
    for kind in ("tracking", "feedforward"):
        film, tracking, feedforward = sp.SimulatedFilm(), sp.Tracking(model, rate_hz=200), sp.Feedforward(model, rate_hz=200)
        reached = [film.displacement_m]
        for k, target in enumerate(sine[1:]):
            sample = film.displacement_m if k % 2 == 0 else None
            tick = tracking.tick(target, sample, age_s=0.0) if kind == "tracking" else feedforward.tick(target)
            reached.append(film.advance(tick.voltage_v, 1 / 200))
        late = slice(20 * 200, None)
        rms[kind] = float(np.sqrt(np.mean((np.array(reached) - sine)[late] ** 2)))
    assert rms["tracking"] < 0.01 * 1e-3
    assert rms["feedforward"] > 5 * rms["tracking"]


def test_tracking_follows_a_film_that_changes() -> None:
    """A film whose stiffness is not the model's: what the sensor has shown in a minute serves as long without it, where tracking adapts."""
    recording = sp.record_film(frequency_hz=[0.2, 0.1], duration_s=60, rate_hz=50)
    model = sp.fit(recording, branches=2, topology="parallel", curve="none", hold=["offset_m"]).model
    stiffer = sp.Model.from_toml(re.sub(r"\{ c = ([^,]+),", lambda found: f"{{ c = {1.2 * float(found[1])!r},", model.to_toml()))
    sine = sp.reference("sine", low_m=1.5e-3, high_m=2.5e-3, period_s=10, duration_s=120, rate_hz=200).displacement_m
    assert sine is not None
    lost = {}
    for adapts in (False, True):
        film, tracking = sp.SimulatedFilm(), sp.Tracking(stiffer, 200, adapts=adapts)
        reached = [film.displacement_m]
        for k, target in enumerate(sine[1:]):
            tick = tracking.tick(target, film.displacement_m if k % 2 == 0 and k < 12_000 else None, age_s=0.0)
            reached.append(film.advance(tick.voltage_v, 1 / 200))
        lost[adapts] = float(np.sqrt(np.mean((np.array(reached) - sine)[14_000:] ** 2)))
        assert (tick.ageing is not None and tick.ageing > 0.5) if adapts else tick.ageing is None
        # A film of 1 / 1.2 of the stiffness.
        assert tick.stiffness_change == (pytest.approx(-1 / 6, abs=0.03) if adapts else None)
    assert lost[True] < 0.02 * 1e-3 and lost[True] < lost[False], lost


def test_a_tick_says_what_limits_it() -> None:
    controller = sp.Feedforward(sp.load("preset:table3-n2"), 1000, limits={"max_voltage_v": 1000})
    ticks = [controller.tick(5e-3) for _ in range(2000)]
    assert max(tick.voltage_v for tick in ticks) == 1000.0
    assert "max-voltage" in ticks[-1].limited and ticks[-1].disturbance_n is None
    assert "velocity" in {name for tick in ticks for name in tick.limited} or "acceleration" in ticks[0].limited


def test_lost_samples_are_none() -> None:
    """NaN is no sample, a reference that is not finite is ignored: the same bits as without."""
    model = sp.load("preset:table3-n2")
    one, other = sp.Tracking(model, 1000), sp.Tracking(model, 1000)
    for k in range(3000):
        sample = 1e-4 if k % 10 == 0 else None
        first = one.tick(1e-3 if k % 7 or k == 0 else math.nan, sample)
        second = other.tick(1e-3, math.nan if sample is None else sample)
        assert first.voltage_v == second.voltage_v


def test_every_name_says_what_it_is() -> None:
    """Docstrings on everything that is public."""
    for name in sp.__all__:
        if name == "__version__":
            continue
        public = getattr(sp, name)
        assert public.__doc__, name
        for member, value in vars(public).items() if isinstance(public, type) else ():
            if not member.startswith("_") and not isinstance(value, (str, float, int, list, type(None))):
                assert value.__doc__, f"{name}.{member}"


@pytest.mark.parametrize("again", [lambda value: pickle.loads(pickle.dumps(value)), copy.deepcopy])
def test_copies_are_equal(again: Callable[[Any], Any]) -> None:
    """A pickled or copied object is the same, to the bit, and goes on by itself."""
    actuator = sp.Actuator(thickness_m=100e-6, preload="from-start", stretch_coupling=-1.5, saturation_v=9000)
    assert again(actuator) == actuator and again(sp.Actuator()) == sp.Actuator()
    model = sp.Model((62740.0, 0.2), [((47958.0, 1.0), (173210.0, 0.5))], actuator=actuator, sensor_offset_m=2e-6)
    assert again(model) == model
    time = np.arange(100) / 7 + 0.3
    gappy = np.where(time > 9, np.nan, 1e-3 * time)
    recording = sp.Recording(time, voltage_v=np.full(100, 1000.0), displacement_m=gappy, name="log")
    copied = again(recording)
    assert copied.path == "log" and np.array_equal(copied.time_s, recording.time_s)
    assert np.array_equal(copied.voltage_v, recording.voltage_v) and copied.force_n is None
    assert np.array_equal(copied.displacement_m, recording.displacement_m, equal_nan=True)
    for precision, method in (("f32", "gl"), ("f64", "bdf2")):
        law = sp.Law(model, 500, method=method, precision=precision)  # type: ignore[arg-type]
        other = again(law)
        assert (repr(other), other.stiffness_n_per_m) == (repr(law), law.stiffness_n_per_m)
        state = law.at_rest()
        state.displacement(np.full(333, 10.0))
        restored = again(state)
        force = 100 * np.sin(np.arange(500) / 30) ** 2
        assert np.array_equal(restored.displacement(force), state.displacement(force))
        restored.displacement(50.0)
        assert restored.displacement_m != state.displacement_m


def test_threads_take_turns() -> None:
    """Two threads step one film: no step is lost, whichever came first."""
    law = sp.Law(sp.load("preset:table3-n2"), 1000)
    force = np.full(400_000, 10.0)
    expected, shared = law.at_rest(), law.at_rest()
    expected.displacement(np.concatenate([force, force]))
    threads = [threading.Thread(target=shared.displacement, args=(force,)) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert shared.displacement_m == expected.displacement_m


def test_threads_take_turns_on_a_film_and_a_controller() -> None:
    """As long as one advances a film or a controller, another waits: nothing is lost and nothing is refused."""
    shared, alone = sp.SimulatedFilm(), sp.SimulatedFilm()
    for _ in range(8):
        alone.advance(3000.0, 0.5)
    controllers = [sp.Feedforward(sp.load("preset:table3-n2"), 1000) for _ in range(2)]
    expected = [controllers[1].tick(1e-3).voltage_v for _ in range(4000)]
    ticked: list[float] = []

    def step() -> None:
        shared.advance(3000.0, 0.5)
        ticked.extend(controllers[0].tick(1e-3).voltage_v for _ in range(500))

    threads = [threading.Thread(target=step) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert shared.displacement_m == alone.displacement_m
    assert sorted(ticked) == sorted(expected)
