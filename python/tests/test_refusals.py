"""Refusals: their exceptions, and the same line as on the command line."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import springpot as sp

from conftest import Tool

TIME = np.arange(100) / 10
VOLTS = 1000 * np.sin(TIME) ** 2
METRES = 1e-3 * np.sin(TIME) ** 2


def test_exceptions_are_the_usual_ones() -> None:
    assert issubclass(sp.InputError, ValueError)
    assert issubclass(sp.FileError, OSError) and issubclass(sp.FileError, ValueError)
    assert issubclass(sp.ComputationError, ArithmeticError)
    for family in (sp.InputError, sp.FileError, sp.ComputationError):
        assert issubclass(family, sp.Error)


NO_ARRAYS: dict[str, tuple[Any, str]] = {
    "two dimensions": (np.zeros((2, 3)), "voltage_v: an array of shape (2, 3); one dimension is needed"),
    "no dimension": (np.float64(1), "voltage_v: an array of shape (); one dimension is needed"),
    "text": (["a", "b"], "voltage_v: dtype <U1; real numbers are needed"),
    "complex": (VOLTS * 1j, "voltage_v: dtype complex128; real numbers are needed"),
    "truth": (VOLTS > 0, "voltage_v: dtype bool; real numbers are needed"),
    "objects": ([None, 1], "voltage_v: dtype object; real numbers are needed"),
    "ragged": ([[1.0], [2.0, 3.0]], "voltage_v: not an array of numbers"),
}


@pytest.mark.parametrize("name", NO_ARRAYS)
def test_no_arrays(name: str) -> None:
    value, line = NO_ARRAYS[name]
    with pytest.raises(sp.InputError) as refusal:
        sp.Recording(TIME, voltage_v=value)
    assert str(refusal.value) == line


BROKEN: dict[str, tuple[dict[str, Any], str]] = {
    "too short": ({"time_s": [0.0], "voltage_v": [1.0]}, "log: time_s has 1 rows; a recording needs at least 2"),
    "other length": ({"voltage_v": VOLTS[:-1]}, "log: 99 values of voltage_v at 100 times"),
    "time is NaN": ({"time_s": np.where(TIME == 5, np.nan, TIME)}, "log: time_s[50] is NaN; no clock shows that"),
    "time goes back": ({"time_s": TIME[::-1]}, "log: time_s[1] is 9.8 after 9.9; times must increase"),
    "infinite": ({"voltage_v": np.where(TIME == 5, np.inf, VOLTS)}, "log: voltage_v[50] is inf; no instrument reads that"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_broken_recordings(name: str) -> None:
    changes, line = BROKEN[name]
    with pytest.raises(sp.InputError) as refusal:
        sp.Recording(**{"time_s": TIME, "voltage_v": VOLTS, "name": "log", **changes})
    assert str(refusal.value) == line


def test_gaps_in_what_drives() -> None:
    gappy = sp.Recording(TIME, voltage_v=np.where(TIME == 5, np.nan, VOLTS), displacement_m=METRES, name="log")
    with pytest.raises(sp.FileError, match=r"^log: voltage_v is empty at 5 s; what drives the film must be complete"):
        sp.simulate(sp.load("preset:table3-n2"), gappy)
    none = sp.Recording(TIME, voltage_v=np.full(100, np.nan), displacement_m=METRES, name="log")
    with pytest.raises(sp.FileError, match=r"^log: neither voltage_v nor force_n has a value$"):
        sp.fit(none)


STRANGE: dict[str, Callable[[npt.NDArray[np.float64]], Any]] = {
    "every other": lambda values: np.repeat(values, 2)[::2],
    "backwards": lambda values: np.ascontiguousarray(values[::-1])[::-1],
    "a column": lambda values: np.column_stack([values, values])[:, 1],
    "big-endian": lambda values: values.astype(">f8"),
    "a list": lambda values: values.tolist(),
    "read-only": lambda values: np.frombuffer(values.tobytes()),
}


@pytest.mark.parametrize("name", STRANGE)
def test_strange_arrays_are_read(name: str) -> None:
    recording = sp.Recording(TIME, voltage_v=STRANGE[name](VOLTS.copy()))
    assert np.array_equal(recording.voltage_v, VOLTS)
    law = sp.Law(sp.load("preset:table3-n2"), 1000, precision="f64")
    assert np.array_equal(law.at_rest().force(STRANGE[name](METRES.copy())), law.at_rest().force(METRES))


def test_other_numbers_are_read() -> None:
    whole = sp.Recording(np.arange(100), voltage_v=np.arange(100, dtype=np.uint8), displacement_m=METRES.astype(np.float32))
    assert whole.voltage_v.tolist() == list(range(100))
    masked = np.ma.masked_array(METRES, mask=TIME == 5)
    recording = sp.Recording(TIME, voltage_v=VOLTS, displacement_m=masked)
    assert np.flatnonzero(np.isnan(recording.displacement_m)).tolist() == [50]


def test_arrays_are_apart() -> None:
    """A recording does not change with its source, and cannot be written to."""
    volts = VOLTS.copy()
    recording = sp.Recording(TIME, voltage_v=volts)
    volts[:] = 0
    assert np.array_equal(recording.voltage_v, VOLTS)
    assert recording.voltage_v is recording.voltage_v
    with pytest.raises(ValueError, match="read-only"):
        recording.voltage_v[0] = 1


MODEL = sp.Model((6e4, 0.2))
SINE = sp.Recording(TIME, displacement_m=METRES)
LOG = sp.Recording(TIME, voltage_v=VOLTS, displacement_m=METRES)
WRONG: Any = {"max_volts": 1.0}
# What is no count or no limit, and what the refusal names.
WRONG_TYPES: dict[str, tuple[str, Callable[[Any], object]]] = {
    "seed": ("seed", lambda value: sp.record_film(duration_s=1, seed=value)),
    "seed of a reference": ("seed", lambda value: sp.reference("sine", low_m=0, high_m=1e-3, period_s=1, duration_s=2, seed=value)),
    "seed of a fit": ("seed", lambda value: sp.fit(LOG, seed=value)),
    "starts": ("starts", lambda value: sp.fit(LOG, starts=value)),
    "decimate": ("decimate", lambda value: sp.read_recording("none.csv", decimate=value)),
    "points": ("points", lambda value: sp.frequency_response(MODEL, 0.1, 1.0, value)),
    "harmonics": ("harmonics", lambda value: sp.Tracking(MODEL, 1000, harmonics=value)),
    "harmonics of a loop": ("harmonics", lambda value: sp.closed_loop(MODEL, SINE, harmonics=value)),
    "seed of a loop": ("seed", lambda value: sp.closed_loop(MODEL, SINE, seed=value)),
    "seed of a comparison": ("seed", lambda value: sp.compare(LOG, seed=value)),
    "starts of a comparison": ("starts", lambda value: sp.compare(LOG, starts=value)),
}


@pytest.mark.parametrize("name", WRONG_TYPES)
@pytest.mark.parametrize("value", [-1, 1.5, "two", [1], None.__class__])
def test_counts_of_a_wrong_type(name: str, value: Any) -> None:
    argument, call = WRONG_TYPES[name]
    with pytest.raises((TypeError, ValueError), match=argument):
        call(value)


@pytest.mark.parametrize("limit", ["high", [1.0], 1j, object()])
def test_limits_of_a_wrong_type(limit: Any) -> None:
    given: Any = {"max_voltage_v": limit}
    for call in (
        lambda: sp.feedforward(MODEL, SINE, limits=given),
        lambda: sp.check_reference(MODEL, SINE, limits=given),
        lambda: sp.Tracking(MODEL, 1000, limits=given),
        lambda: sp.closed_loop(MODEL, SINE, limits=given),
    ):
        with pytest.raises(ValueError, match="^max_voltage_v: "):
            call()
    with pytest.raises(TypeError, match="limits"):
        sp.feedforward(MODEL, SINE, limits=limit)


def test_arguments_of_a_wrong_type_are_named() -> None:
    wrong: Any = 5
    for name, call in (
        ("recordings", lambda: sp.replay(MODEL, wrong)),
        ("recordings", lambda: sp.fit([wrong])),
        ("recording", lambda: sp.simulate(MODEL, [LOG, LOG])),  # type: ignore[arg-type]
        ("weights", lambda: sp.fit(LOG, weights=["heavy"])),  # type: ignore[list-item]
        ("free", lambda: sp.fit(LOG, free="stretch_coupling")),
        ("rate_hz", lambda: sp.Law(MODEL, "fast")),  # type: ignore[arg-type]
        ("film", lambda: sp.closed_loop(MODEL, SINE, film=wrong)),
        ("film", lambda: sp.closed_loop(MODEL, SINE, film="paper")),  # type: ignore[arg-type]
        ("controller", lambda: sp.closed_loop(MODEL, SINE, controller="best")),  # type: ignore[arg-type]
        ("alpha", lambda: sp.closed_loop(MODEL, SINE, alpha=1.1)),
        ("stiffness", lambda: sp.closed_loop(MODEL, SINE, stiffness=math.nan)),
        ("sensor_lost_s", lambda: sp.closed_loop(MODEL, SINE, sensor_lost_s=[(2, 1)])),
        ("sensor_noise_m", lambda: sp.closed_loop(MODEL, SINE, sensor_noise_m=-1)),
        ("to_s", lambda: sp.compare(LOG, to_s=0)),
        ("tolerance", lambda: sp.reduce(MODEL, tolerance=2)),
        ("from_hz", lambda: sp.reduce(MODEL, from_hz=0)),
        ("to_hz", lambda: sp.reduce(MODEL, from_hz=1, to_hz=0.5)),
        ("emit", lambda: sp.export(MODEL, "film.c", emit="java")),  # type: ignore[arg-type]
        ("rate_hz", lambda: sp.export(MODEL, "film.bin", rate_hz=0)),
        ("path", lambda: sp.export(MODEL, wrong)),
    ):
        with pytest.raises((TypeError, ValueError), match=name):
            call()


def test_controllers_need_a_rate() -> None:
    kinds: Any = (sp.Tracking, sp.Feedforward, sp.Observer)
    for kind in kinds:
        with pytest.raises(TypeError, match="rate_hz"):
            kind(MODEL)


def test_sizes_in_other_units() -> None:
    with pytest.raises(sp.InputError, match=r"^actuator: length_m = 40 is 40 m: is it in millimetres\? write 0.04$"):
        sp.Actuator(length_m=40)
    with pytest.raises(sp.InputError, match="thickness_m = 160 is 160 m: is it in micrometres\\? write 0.00016; mass_kg = 316"):
        sp.Actuator(thickness_m=160, mass_kg=316)
    with pytest.warns(UserWarning, match="is it in grams"):
        sp.Actuator(thickness_m=20e-6, mass_kg=5)


def test_an_unknown_field_is_warned_of(films: list[Path], sine: Path) -> None:
    """The sizes of a fit without an actuator are assumed: no limit of the field is kept in silence."""
    model = sp.fit(films[0], branches=0, topology="parallel", curve="none").model
    for call in (lambda: sp.feedforward(model, sine), lambda: sp.Tracking(model, 1000), lambda: sp.check_reference(model, sine)):
        with pytest.warns(UserWarning, match="sizes are assumed"):
            call()


def test_errors_name_arguments(tmp_path: Path) -> None:
    """Never a flag of the command line."""
    strange = tmp_path / "lab.csv"
    strange.write_text("a,b,c\n0,1,2\n1,2,3\n2,3,4\n", encoding="utf-8")
    for columns in (None, "time=9,voltage=1"):
        with pytest.raises(sp.Error) as refusal:
            sp.read_recording(strange, columns=columns)
        assert "columns" in str(refusal.value) and "--" not in str(refusal.value), str(refusal.value)


LAWS: dict[str, Callable[[], object]] = {
    "model: main springpot: alpha = 1.5 must be within 0 and 1": lambda: sp.Model((60e3, 1.5)),
    "rate_hz: NaN Hz must be finite and greater than 0": lambda: sp.Law(sp.Model((6e4, 0.2)), math.nan),
    'topology: "ring" is not one of parallel, eq11': lambda: sp.Model((6e4, 0.2), topology="ring"),  # type: ignore[arg-type]
    'precision: "f16" is not one of f32, f64': lambda: sp.Law(sp.Model((6e4, 0.2)), 1000, precision="f16"),  # type: ignore[arg-type]
    'memory: use compressed, full or window:SECONDS with seconds above 0, such as window:10s': lambda: sp.simulate(
        sp.Model((6e4, 0.2)), sp.Recording(TIME, voltage_v=VOLTS), memory="short"
    ),
    'limits: no limit "max_volts"; there are max_voltage_v, max_field_v_per_m, max_slew_v_per_s, max_velocity_m_per_s, '
    "max_acceleration_m_per_s2": lambda: sp.Feedforward(sp.Model((6e4, 0.2)), 1000, limits=WRONG),
    "max_voltage_v: -1.0 must be finite and greater than 0": lambda: sp.Feedforward(sp.Model((6e4, 0.2)), 1000, limits={"max_voltage_v": -1}),
    "sensor_offset_m: NaN must be finite": lambda: sp.Model((6e4, 0.2), sensor_offset_m=math.nan),
    "start: gives actuator as well; leave one of them out": lambda: sp.fit(
        sp.Recording(TIME, voltage_v=VOLTS, displacement_m=METRES), start=sp.Model((6e4, 0.2)), actuator=sp.Actuator()
    ),
    "recordings: none is given": lambda: sp.fit([]),
}


@pytest.mark.parametrize("line", LAWS)
def test_refused_arguments(line: str) -> None:
    with pytest.raises(sp.InputError) as refusal:
        LAWS[line]()
    assert str(refusal.value) == line


@pytest.mark.parametrize("precision", ["f32", "f64"])
def test_steps_of_no_number_change_nothing(precision: Any) -> None:
    law = sp.Law(sp.load("preset:table3-n2"), 1000, precision=precision)
    state, other = law.at_rest(), law.at_rest()
    state.displacement(10.0)
    other.displacement(10.0)
    gappy = np.array([1.0, np.nan, 2.0])
    for call, line in (
        (lambda: state.displacement(math.nan), "force_n: NaN must be finite"),
        (lambda: state.displacement(gappy), "force_n[1]: NaN must be finite"),
        (lambda: state.force(np.array([0.0, 0.0, -np.inf])), "displacement_m[2]: -inf must be finite"),
        (lambda: state.displacement(-1e20), "force_n: -1e20 must be within 1e15"),
    ):
        with pytest.raises(sp.InputError) as refusal:
            call()
        assert str(refusal.value) == line
    assert state.displacement(5.0) == other.displacement(5.0)
    # One number in an array is an array.
    one = state.displacement(np.array([5.0]))
    assert one.shape == (1,) and one[0] == other.displacement(5.0)
    assert state.displacement([]).shape == (0,)


def test_ticks_of_no_number_change_nothing() -> None:
    model = sp.load("preset:table3-n2")
    tracking, other = sp.Tracking(model, 1000), sp.Tracking(model, 1000)
    observer, alone = sp.Observer(model, 1000), sp.Observer(model, 1000)
    for k in range(100):
        with pytest.raises(sp.InputError, match="^applied_v: NaN must be finite$"):
            tracking.tick(1e-3, applied_v=math.nan)
        with pytest.raises(sp.InputError, match="^age_s: NaN must be finite$"):
            tracking.tick(1e-3, 1e-3, age_s=math.nan)
        with pytest.raises(sp.InputError, match="^age_s: -0.01 must not be negative$"):
            observer.tick(10.0 * k, 1e-3, age_s=-0.01)
        with pytest.raises(sp.InputError, match="^voltage_v: inf must be finite$"):
            observer.tick(math.inf)
        # What a monitor or a sensor reads may be anything.
        assert tracking.tick(1e-3, math.inf, monitor_v=math.nan).voltage_v == other.tick(1e-3).voltage_v
        assert observer.tick(10.0 * k, math.nan).displacement_m == alone.tick(10.0 * k).displacement_m


def test_states_come_from_laws() -> None:
    with pytest.raises(TypeError, match="comes from a Law"):
        sp.State()
    with pytest.raises(TypeError):
        sp.Law("film.toml", 1000)  # type: ignore[arg-type]


def same_line(tool: Tool, arguments: Sequence[object], family: type[sp.Error], call: Callable[[], object]) -> None:
    """``call`` is refused with what the command says, arguments in place of flags: ``from_s`` of ``--from``."""
    line = tool.refusal(*arguments)
    with pytest.raises(family) as refusal:
        call()
    arguments = re.sub(r"--([a-z-]+)", lambda flag: flag[1].replace("-", "_") + r"(_[a-z0-9_]+)?", re.escape(line).replace(r"\-", "-"))
    assert re.fullmatch(arguments, str(refusal.value)), (line, str(refusal.value))


def test_lines_are_those_of_the_command_line(tool: Tool, films: list[Path], sine: Path, tmp_path: Path) -> None:
    out = ["--out", "x.csv"]
    missing = tmp_path / "missing.csv"
    same_line(tool, ["replay", "--params", "preset:table3-n2", missing], sp.FileError, lambda: sp.read_recording(missing))
    same_line(tool, ["replay", "--params", missing, films[0]], sp.FileError, lambda: sp.load(missing))
    same_line(tool, ["replay", "--params", "preset:x", films[0]], sp.InputError, lambda: sp.load("preset:x"))
    model = sp.load("preset:table3-n2")

    broken = tmp_path / "broken.csv"
    broken.write_text("time_s,voltage_v,displacement_m\n0,0,0\n1,x,0\n", encoding="utf-8")
    same_line(tool, ["replay", "--params", "preset:table3-n2", broken], sp.FileError, lambda: sp.replay(model, broken))
    short = tmp_path / "short.csv"
    short.write_text("time_s,voltage_v,displacement_m\n0,0,0\n1,5,1e-5\n", encoding="utf-8")
    same_line(tool, ["fit", short, "--out", "x.toml"], sp.FileError, lambda: sp.fit(short))
    closed = tmp_path / "closed.toml"
    closed.write_text(model.to_toml().replace("alpha = 0.2", "alpha = 2.0"), encoding="utf-8")
    same_line(tool, ["replay", "--params", closed, films[0]], sp.FileError, lambda: sp.load(closed))

    # A law that no rate serves, one without an inverse, and a film that is pulled in.
    run = ["simulate", "--params", "preset:table3-n2", "--profile", films[0], *out]
    same_line(tool, [*run, "--rate", "1e-5"], sp.InputError, lambda: sp.simulate(model, films[0], rate_hz=1e-5))
    pulled = tmp_path / "pulled.toml"
    pulled.write_text(model.to_toml().replace("stretch_coupling = 0.0", "stretch_coupling = 5000.0"), encoding="utf-8")
    arguments = ["simulate", "--params", pulled, "--profile", films[0], *out]
    same_line(tool, arguments, sp.InputError, lambda: sp.simulate(sp.load(pulled), films[0]))
    arguments = [*arguments, "--memory", "full"]
    same_line(tool, arguments, sp.ComputationError, lambda: sp.simulate(sp.load(pulled), films[0], memory="full"))

    fit = ["fit", films[0], "--out", "x.toml"]
    same_line(tool, [*fit, "--free", "colour"], sp.InputError, lambda: sp.fit(films[0], free=["colour"]))
    same_line(tool, [*fit, "--weights", "1,2"], sp.InputError, lambda: sp.fit(films[0], weights=[1, 2]))
    same_line(tool, [*fit, "--starts", "0"], sp.InputError, lambda: sp.fit(films[0], starts=0))
    same_line(tool, [*fit, "--from", "50s"], sp.FileError, lambda: sp.fit(films[0], from_s=50))
    observe = ["observe", "--params", "preset:table3-n2", films[0], "--bandwidth", "9", *out]
    same_line(tool, observe, sp.InputError, lambda: sp.observe(model, films[0], bandwidth_hz=9))
    sweep = ["frequency-response", "--params", "preset:table3-n2", "--from", "1", "--to", "0.1", "--points", "5", *out]
    same_line(tool, sweep, sp.InputError, lambda: sp.frequency_response(model, 1, 0.1, 5))
    loop = ["closed-loop", "--plant", "hossain", "--params", "preset:table3-n2", "--reference", sine, "--controller", "tracking"]
    same_line(tool, [*loop, "--bandwidth", "8"], sp.InputError, lambda: sp.Tracking(model, 1000, bandwidth_hz=8))
    gone = tmp_path / "no" / "film.toml"
    with pytest.raises(sp.FileError, match="film.toml"):
        sp.save(model, gone)
    assert not gone.parent.exists()
