"""Figures are those of the command line, which runs in a process of its own: every number, not nearly."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import springpot as sp

from conftest import Columns, Tool, read_csv

Table = Callable[..., Columns]


def assert_equal(columns: dict[str, Any], table: Columns, names: list[str]) -> None:
    for name in names:
        assert np.array_equal(columns[name], table[name], equal_nan=True), name


@pytest.mark.parametrize("memory", ["compressed", "full", "window:10s"])
@pytest.mark.parametrize("precision", ["f32", "f64"])
def test_simulate(table: Table, films: list[Path], memory: str, precision: Any) -> None:
    expected = table(
        "simulate", "--params", "preset:table3-n2", "--profile", films[0], "--rate", 500, "--memory", memory, "--precision", precision
    )
    response = sp.simulate(sp.load("preset:table3-n2"), films[0], rate_hz=500, memory=memory, precision=precision)
    assert len(response.time_s) == 20_001
    assert_equal(response.columns(), expected, ["time_s", "voltage_v", "force_n", "displacement_m"])


def test_second_order(table: Table, films: list[Path]) -> None:
    expected = table("simulate", "--params", "preset:table4-f7", "--profile", films[1], "--rate", 100, "--method", "bdf2")
    response = sp.simulate(sp.load("preset:table4-f7"), films[1], rate_hz=100, method="bdf2")
    assert_equal(response.columns(), expected, ["time_s", "voltage_v", "force_n", "displacement_m"])


@pytest.mark.parametrize("drive", ["force", "displacement"])
def test_replay(tool: Tool, films: list[Path], fitted: tuple[Path, Any], drive: Any) -> None:
    expected = tool.json("replay", "--params", fitted[0], "--drive", drive, *films, "--out", "replayed")
    replay = sp.replay(sp.load(fitted[0]), films, drive=drive)
    assert replay.r2_mean == expected["r2_mean"]
    unit = "rmse_m" if drive == "force" else "rmse_n"
    for row, other in zip(replay.recordings, expected["recordings"], strict=True):
        assert (row.file, row.r2, row.nrmse_pct, row.samples) == tuple(other[key] for key in ("file", "r2", "nrmse_pct", "samples"))
        assert row.rmse == other[unit]
        written = read_csv(tool.folder / "replayed" / Path(row.file).name)
        assert_equal(row.response.columns(), written, ["time_s", "force_n", "displacement_m"])
        # The measures, once more from the series: in double precision, so to the rounding of a sum of 2000.
        assert np.sqrt(np.mean((row.measured - row.modelled) ** 2)) == pytest.approx(row.rmse, rel=1e-12)


def _keys(document: Any) -> Any:
    """The keys of a document, of its tables and of the rows of its lists."""
    if isinstance(document, dict):
        return {key: _keys(value) for key, value in document.items()}
    return [_keys(row) for row in document] if isinstance(document, list) else None


def _unmarked(text: str) -> str:
    """Returns the text without the marks of options: the command line writes --actuator, Python actuator, its files `actuator`."""
    return re.sub(r"--(?=[a-z])|`", "", text)


def test_fit(tool: Tool, films: list[Path], fitted: tuple[Path, Any]) -> None:
    path, expected = fitted
    result = sp.fit(films, branches=1, topology="parallel", curve="none")
    # Parameters, provenance with its digests, and intervals.
    assert _unmarked(result.model.to_toml()) == _unmarked(path.read_text(encoding="utf-8"))
    for key in ("r2_mean", "evaluations", "topology", "branches", "interrupted", "structures", "relaxations"):
        assert getattr(result, key) == expected[key], key
    # One document: no key has another name, and none is missing.
    assert _keys(result.to_dict()) == _keys({**expected, "made": None})
    names = {"name", "value", "low", "high", "at_bound"}
    for parameter, other in zip(result.parameters, expected["uncertainty"]["estimates"], strict=True):
        assert {name: getattr(parameter, name) for name in names} == {name: other[name] for name in names}
        assert parameter.linear == (None if other["linear"] is None else tuple(other["linear"]))
    assert result.undetermined == expected["uncertainty"]["undetermined"]
    assert [_unmarked(warning.text) for warning in result.warnings] == [_unmarked(text) for text in expected["warnings"]]
    for row, other in zip(result.recordings, expected["recordings"], strict=True):
        assert (row.r2, row.nrmse_pct, row.rmse, row.rate_hz) == tuple(other[key] for key in ("r2", "nrmse_pct", "rmse_m", "rate_hz"))


def test_fit_of_arrays_is_that_of_files(films: list[Path], fitted: tuple[Path, Any]) -> None:
    recordings = []
    for path in films:
        columns = read_csv(path)
        made = sp.Recording(columns["time_s"], voltage_v=columns["voltage_v"], displacement_m=columns["displacement_m"], name=str(path))
        recordings.append(made)
    model = sp.fit(recordings, branches=1, topology="parallel", curve="none").model
    expected = sp.load(fitted[0])
    assert (model.main, model.branches, model.actuator) == (expected.main, expected.branches, expected.actuator)
    # No file, no digest.
    assert "sha256" not in model.to_toml()


def test_fit_options(tool: Tool, films: list[Path], fitted: tuple[Path, Any]) -> None:
    options = ["--loss", "huber", "--weights", "2,1", "--from", "5", "--hold", "offset_m", "--free", "mass_kg", "--seed", "7", "--starts", "2"]
    path = "options.toml"
    tool.json("fit", *films, "--branches", 0, "--topology", "parallel", "--curve", "none", *options, "--out", path)
    result = sp.fit(
        films,
        branches=0,
        topology="parallel",
        curve="none",
        loss="huber",
        weights=[2, 1],
        from_s=5,
        hold=["offset_m"],
        free=["mass_kg"],
        seed=7,
        starts=2,
    )
    assert _unmarked(result.model.to_toml()) == _unmarked((tool.folder / path).read_text(encoding="utf-8"))
    tool.json("fit", *films, "--start", fitted[0], "--curve", "none", "--hold", "main.alpha", "--out", path)
    result = sp.fit(films, start=sp.load(fitted[0]), curve="none", hold=["main.alpha"])
    assert _unmarked(result.model.to_toml()) == _unmarked((tool.folder / path).read_text(encoding="utf-8"))
    assert result.model.main[1] == sp.load(fitted[0]).main[1]


def test_feedforward(tool: Tool, table: Table, sine: Path) -> None:
    options = ["--params", "preset:table3-n2", "--reference", sine, "--max-voltage", 5000]
    expected = table("feedforward", *options)
    report = tool.json("feedforward", *options, "--check", "--out", "again.csv")
    model = sp.load("preset:table3-n2")
    plan = sp.feedforward(model, sine, limits={"max_voltage_v": 5000})
    assert_equal(plan.columns(), expected, ["time_s", "voltage_v", "displacement_m", "reference_m", "limited"])
    assert plan.limits_met == {met["limit"]: met["pct"] for met in report["limits_met"]}
    assert plan.voltage_v.max() == report["largest_voltage_v"]
    assert sp.check_reference(model, sine, limits={"max_voltage_v": 5000}) == report["check"]


def test_observe(table: Table, tool: Tool, films: list[Path], fitted: tuple[Path, Any]) -> None:
    options = ["--params", fitted[0], films[0], "--bandwidth", 0.4, "--adaptation", 20, "--rate", 500, "--every", 1]
    expected = table("observe", *options)
    report = tool.json("observe", *options, "--out", "again.csv")
    observed = sp.observe(sp.load(fitted[0]), films[0], bandwidth_hz=0.4, adaptation_s=20, rate_hz=500)
    assert_equal(observed.columns(), expected, list(expected))
    assert (observed.samples, observed.innovation_rms_m) == (report["samples"], report["innovation_rms_m"])
    assert observed.bandwidth_hz == report["bandwidth_hz"]


@pytest.mark.parametrize("law_hz", [None, 500.0])
def test_frequency_response(table: Table, law_hz: float | None) -> None:
    options = [] if law_hz is None else ["--discrete", "--rate", law_hz]
    expected = table("frequency-response", "--params", "preset:table3-n5", "--from", 0.001, "--to", 100, "--points", 60, *options)
    response = sp.frequency_response(sp.load("preset:table3-n5"), 0.001, 100, 60, law_hz=law_hz)
    assert_equal(response.columns(), expected, ["frequency_hz", "magnitude_m_per_n", "phase_rad"])


def test_simulated_recordings_and_references(films: list[Path], sine: Path) -> None:
    film = sp.record_film("hossain", frequency_hz=[1 / 7], duration_s=40, rate_hz=50)
    expected = read_csv(films[1])
    assert np.array_equal(film.voltage_v, expected["voltage_v"])
    assert np.array_equal(film.displacement_m, expected["displacement_m"])
    reference = sp.reference("sine", low_m=1.5e-3, high_m=2.5e-3, period_s=10, duration_s=30)
    assert np.array_equal(reference.displacement_m, read_csv(sine)["displacement_m"])


@pytest.mark.parametrize("controller", ["tracking", "feedforward"])
def test_ticks(table: Table, fitted: tuple[Path, Any], sine: Path, controller: str) -> None:
    """A loop closed by the host tool, once more tick by tick: a sensor of 50 Hz, 20 ms late, with neither noise nor steps."""
    sensor = ["--sensor-rate", 50, "--sensor-delay", "20ms", "--sensor-noise", 0, "--sensor-quantum", 0, "--bandwidth", 0.5]
    run = table("closed-loop", "--plant", "hossain", "--params", fitted[0], "--reference", sine, "--controller", controller, *sensor)
    reference = read_csv(sine)["displacement_m"]
    model = sp.load(fitted[0])
    assert abs(model.sensor_offset_m) > 0.0
    tracking = sp.Tracking(model, 1000, sensor_rate_hz=50, sensor_delay_s=0.02, bandwidth_hz=0.5)
    feedforward = sp.Feedforward(model, 1000)
    for k in range(len(reference)):
        target = reference[min(k + 1, len(reference) - 1)]
        # Taken every 20 ms. The simulated film has no offset, the sensor of these parameters has.
        late = k >= 20 and k % 20 == 0
        sample = run["displacement_m"][k - 20] + model.sensor_offset_m if late else None
        tick = tracking.tick(target, sample) if controller == "tracking" else feedforward.tick(target)
        # Adding the offset and taking it off again costs a rounding of the sample; nothing else differs.
        assert tick.voltage_v == pytest.approx(run["voltage_v"][k], rel=1e-6, abs=1e-3), k
        assert tick.displacement_m == pytest.approx(run["estimate_m"][k], rel=1e-6, abs=1e-9), k


def test_observer_ticks(films: list[Path], fitted: tuple[Path, Any]) -> None:
    """The observer over a recording, once more tick by tick: the same bits."""
    model, film = sp.load(fitted[0]), sp.read_recording(films[0])
    expected = sp.observe(model, film, rate_hz=50, bandwidth_hz=0.4)
    observer = sp.Observer(
        model, rate_hz=50, bandwidth_hz=0.4, sensor_rate_hz=50, sensor_delay_s=0, max_voltage_v=float(film.voltage_v.max())
    )
    for k in range(len(film)):
        estimate = observer.tick(film.voltage_v[k], film.displacement_m[k])
        assert estimate.displacement_m == expected.displacement_m[k]
        assert estimate.disturbance_n == expected.disturbance_n[k]
        assert estimate.force_scale == expected.force_scale[k]
        assert estimate.innovation_m == expected.innovation_m[k]
        assert estimate.innovation_std_m == expected.innovation_std_m[k]


@pytest.mark.parametrize("film", ["hossain", "preset:table3-n3"])
@pytest.mark.parametrize("controller", ["tracking", "feedforward", "none"])
def test_closed_loop(tool: Tool, sine: Path, film: str, controller: Any) -> None:
    options: list[object] = ["--rate", 200, "--stiffness", 1.1, "--seed", 7, "--sensor-lost", "5:8", "--amplifier-lag", 0.01, "--every", 1]
    arguments = ["closed-loop", "--plant", film, "--params", "preset:table3-n2", "--reference", sine, "--controller", controller]
    expected = tool.json(*arguments, *options, "--out", "loop.csv")
    run = sp.closed_loop(
        sp.load("preset:table3-n2"),
        sine,
        film="hossain" if film == "hossain" else sp.load(film),
        controller=controller,
        rate_hz=200,
        stiffness=1.1,
        seed=7,
        sensor_lost_s=[(5, 8)],
        amplifier_lag_s=0.01,
    )
    table = read_csv(tool.folder / "loop.csv")
    assert set(table) - {"estimate_m", "disturbance_n", "force_scale"} == {"time_s", "voltage_v", "displacement_m", "reference_m", "limited"}
    assert_equal(run.columns(), table, list(table))
    assert {key: expected[key] for key in run.quality} == run.quality and run.quality["rms_m"] > 0


def test_compare(tool: Tool, films: list[Path]) -> None:
    expected = tool.json("compare", *films, "--starts", 1, "--to", 30)["models"]
    stages: list[str] = []
    rows = sp.compare(films, starts=1, to_s=30, progress=lambda stage: stages.append(stage.what))
    # The time of a step is this machine's.
    assert [{**vars(row), "step_ns": 0} for row in rows] == [{"beyond_pct": None, **row, "step_ns": 0} for row in expected]
    assert len(rows) > 5 and len(stages) == len(rows)


def test_reduce(tool: Tool) -> None:
    expected = tool.json("reduce", "--params", "preset:table3-n5", "--tolerance", 1e-3, "--from", 1e-3, "--to", 10, "--out", "small.toml")
    model = sp.load("preset:table3-n5")
    reduction = sp.reduce(model, tolerance=1e-3, from_hz=1e-3, to_hz=10)
    assert reduction.model.to_toml() == (tool.folder / "small.toml").read_text(encoding="utf-8")
    assert (reduction.steps, reduction.largest_change) == (expected["steps"], expected["largest_change"])
    assert len(reduction.model.branches) == expected["branches"] < len(model.branches) == expected["branches_before"]


@pytest.mark.parametrize("out", ["film.bin", "film.rs", "film.c", "film_sfun/film.c", "arduino_film", "film.fmu"])
def test_export(tool: Tool, out: str, tmp_path: Path) -> None:
    emit: Any = {"film_sfun/film.c": "sfunction", "arduino_film": "arduino"}.get(out)
    for folder in (tool.folder / "exported", tmp_path):
        (folder / out).parent.mkdir(parents=True, exist_ok=True)
    options = ["--emit", emit] if emit else []
    expected = tool.json("export", "--params", "preset:table3-n2", "--rate", 500, *options, "--out", f"exported/{out}")["written"]
    written = sp.export(sp.load("preset:table3-n2"), tmp_path / out, rate_hz=500, emit=emit)
    assert len(written) == len(expected)
    for path, other in zip(written, expected, strict=True):
        assert Path(path).relative_to(tmp_path) == Path(other).relative_to("exported")
        assert Path(path).read_bytes() == (tool.folder / other).read_bytes(), path
