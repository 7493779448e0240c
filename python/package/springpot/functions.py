"""The functions of this package. Each is the command of the same name, called without files in between.

All release the interpreter's lock, and Ctrl-C ends them.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Sequence
from os import PathLike
from typing import Any, Literal, TypeAlias

from . import _native
from ._native import Actuator, Model, Recording, Stage
from .limits import Limits
from .results import (
    FitRecording,
    FitResult,
    FitWarning,
    FrequencyResponse,
    Observation,
    Parameter,
    Replay,
    ReplayRecording,
    Response,
    VoltagePlan,
)

__all__ = ["check_reference", "feedforward", "fit", "frequency_response", "observe", "replay", "simulate"]

Path: TypeAlias = str | PathLike[str]
Drive: TypeAlias = Literal["force", "displacement"]
Method: TypeAlias = Literal["gl", "bdf2"]
Precision: TypeAlias = Literal["f32", "f64"]


# What a FitResult has from the report as it is.
_REPORTED = ("r2_mean", "topology", "branches", "drive", "evaluations", "seconds", "interrupted", "structures", "relaxations")


def _all(recordings: Recording | Path | Iterable[Recording | Path]) -> list[Recording]:
    """One recording or several, read where they are named."""
    several = [recordings] if isinstance(recordings, (Recording, str, PathLike)) else list(recordings)
    return [one if isinstance(one, Recording) else _native.read_recording(one) for one in several]


def simulate(
    model: Model,
    recording: Recording | Path,
    *,
    rate_hz: float = 1000.0,
    memory: str = "compressed",
    precision: Precision = "f32",
    method: Method = "gl",
    drive: Drive = "force",
) -> Response:
    """The response of ``model`` to the input of ``recording``, at ``rate_hz`` steps per second.

    The input is the voltage, or the force where there is no voltage; with ``drive="displacement"`` it is the displacement. It is
    interpolated to the steps. ``memory`` is ``"compressed"`` (what a controller runs), ``"full"``, or ``"window:10s"``.

    Raises :class:`springpot.InputError` for a model or an option that is refused, :class:`springpot.FileError` for a recording without an
    input, :class:`springpot.ComputationError` for a film that is pulled in.
    """
    [source] = _all(recording)
    return Response(**_native.simulate(model, source, rate_hz, memory, precision, method, drive))


def replay(
    model: Model,
    recordings: Recording | Path | Iterable[Recording | Path],
    *,
    drive: Drive = "force",
    rate_hz: float = 1000.0,
    memory: str = "compressed",
    precision: Precision = "f32",
    method: Method = "gl",
) -> Replay:
    """Responses of ``model`` to ``recordings``, compared with what was measured, at the times at which it was.

    Options and errors as :func:`simulate`.
    """
    r2_mean, rows = _native.replay(model, _all(recordings), drive, rate_hz, memory, precision, method)
    return Replay(r2_mean, [ReplayRecording(**{**row, "response": Response(**row["response"])}) for row in rows])


def feedforward(
    model: Model,
    reference: Recording | Path,
    *,
    rate_hz: float = 1000.0,
    memory: str = "compressed",
    precision: Precision = "f32",
    method: Method = "gl",
    limits: Limits | None = None,
) -> VoltagePlan:
    """The voltage that takes ``model`` along the displacement of ``reference`` (m over s), within ``limits``.

    A path is read with :func:`springpot.read_reference`. Options and errors as :func:`simulate`.
    """
    plan = _native.feedforward(model, _reference(reference), rate_hz, memory, precision, method, _given(limits))
    return VoltagePlan(**{**plan, "limits_met": dict(plan["limits_met"])})


def check_reference(
    model: Model,
    reference: Recording | Path,
    *,
    rate_hz: float = 1000.0,
    method: Method = "gl",
    limits: Limits | None = None,
) -> dict[str, Any]:
    """Checks whether ``model`` can follow ``reference`` within ``limits``, and what would make it so: ``check`` of ``feedforward --check --json``.

    ``["feasible"]`` is the answer, ``["binding"]`` the limits in the way, ``["least_offset_m"]`` and ``["most_offset_m"]`` the offsets (m)
    that make it feasible, ``["smaller"]`` a smaller reference that is.
    """
    found: dict[str, Any] = json.loads(
        _native.check_reference(model, _reference(reference), rate_hz, method, _given(limits))
    )
    return found


def observe(
    model: Model,
    recording: Recording | Path,
    *,
    rate_hz: float = 1000.0,
    bandwidth_hz: float = 0.6,
    adaptation_s: float = 30.0,
    precision: Precision = "f32",
    method: Method = "gl",
) -> Observation:
    """The observer over a recording of voltage and displacement, ``rate_hz`` ticks per second.

    Below ``bandwidth_hz`` the estimate follows the sensor, above it the model. Over ``adaptation_s`` a disturbance that swings with the load
    becomes a change of the force scale; 0 for never.
    """
    [source] = _all(recording)
    return Observation(**_native.observe(model, source, rate_hz, bandwidth_hz, adaptation_s, precision, method))


def frequency_response(
    model: Model, from_hz: float, to_hz: float, points: int = 200, *, at_m: float = 0.0, law_hz: float | None = None
) -> FrequencyResponse:
    """Displacement over force at ``points`` frequencies, evenly spaced on a logarithmic scale.

    Of the continuous Eq. 11, or with ``law_hz`` of the law that a controller steps at that rate; of a film with an elastic curve for small
    oscillations about ``at_m`` (m).
    """
    return FrequencyResponse(*_native.frequency_response(model, from_hz, to_hz, points, at_m, law_hz))


def fit(
    recordings: Recording | Path | Iterable[Recording | Path],
    *,
    branches: int | Literal["auto"] = "auto",
    topology: Literal["eq11", "parallel", "auto"] = "auto",
    curve: Literal["auto", "none", "saturation", "mooney-rivlin", "gent", "free", "both"] = "auto",
    method: Literal["lm", "pattern-search"] = "lm",
    drive: Drive = "force",
    free: Sequence[str] = (),
    hold: Sequence[str] = (),
    actuator: Actuator | Model | Path | None = None,
    start: Model | None = None,
    loss: Literal["square", "huber"] = "square",
    weights: Sequence[float] | Literal["log-time"] | None = None,
    offset: Literal["joint", "per-recording"] = "joint",
    gain: Literal["joint", "per-recording"] = "joint",
    gap_s: float | None = None,
    at_gap: Literal["end", "skip"] = "end",
    invert: bool = False,
    from_s: float = 0.0,
    to_s: float | None = None,
    seed: int = 1,
    starts: int = 8,
    progress: Callable[[Stage], bool | None] | None = None,
) -> FitResult:
    """The parameters of a model from ``recordings``, jointly; every option is that of the command ``fit``.

    Without ``actuator`` the paper's sizes are assumed, and a warning says so. ``start`` gives branches and topology.

    ``progress`` is called with every stage as it begins, on the thread of the caller. If it returns False the search ends with the best so far
    (``interrupted``); what it raises ends the search and is raised. Ctrl-C raises KeyboardInterrupt.

    Raises :class:`springpot.FileError` for a recording that cannot be fitted, :class:`springpot.InputError` for an option that cannot be
    used, :class:`springpot.ComputationError` where no start leads to a fit.
    """
    options: dict[str, object] = {
        "branches": None if start is not None and branches == "auto" else branches,
        "topology": topology,
        "curve": curve,
        "method": method,
        "drive": drive,
        "free": list(free),
        "hold": list(hold),
        "actuator": actuator,
        "start": start,
        "loss": loss,
        "weights": weights if weights is None or isinstance(weights, str) else [float(weight) for weight in weights],
        "offset": offset,
        "gain": gain,
        "gap_s": gap_s,
        "at_gap": at_gap,
        "invert": invert,
        "from_s": from_s,
        "to_s": to_s,
        "seed": seed,
        "starts": starts,
    }
    model, text, series, severities = _native.fit(_all(recordings), options, progress)
    report = json.loads(text)
    uncertainty = report["uncertainty"] or {"estimates": [], "undetermined": []}
    nan = float("nan")
    return FitResult(
        model=model,
        recordings=[
            FitRecording(
                file=row["file"],
                r2=nan if row["r2"] is None else row["r2"],
                nrmse_pct=nan if row["nrmse_pct"] is None else row["nrmse_pct"],
                rmse=row["rmse_m"] if drive == "force" else row["rmse_n"],
                samples=row["samples"],
                rate_hz=row["rate_hz"],
                offset=row.get("offset"),
                gain=row.get("gain"),
                time_s=time_s,
                measured=measured,
                modelled=modelled,
            )
            for row, (time_s, measured, modelled) in zip(report["recordings"], series, strict=True)
        ],
        parameters=[
            Parameter(**{**row, "linear": None if row["linear"] is None else tuple(row["linear"])})
            for row in uncertainty["estimates"]
        ],
        undetermined=uncertainty["undetermined"],
        warnings=[FitWarning(severity, text) for severity, text in zip(severities, report["warnings"], strict=True)],
        curve=report["film"]["curve"],
        report=report,
        **{name: report[name] for name in _REPORTED},
    )


def _reference(reference: Recording | Path) -> Recording:
    return reference if isinstance(reference, Recording) else _native.read_reference(reference)


def _given(limits: Limits | None) -> dict[str, float] | None:
    return None if limits is None else {name: float(value) for name, value in limits.items()}  # type: ignore[arg-type]
