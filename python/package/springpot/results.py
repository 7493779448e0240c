"""Results of the functions of this package: arrays of one dimension, float64, one value per sample, in SI units.

Every result that has columns gives them as a dictionary with ``columns()``, which ``pandas.DataFrame`` takes as it is.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from ._native import Model

__all__ = [
    "ClosedLoop",
    "ComparedModel",
    "FitRecording",
    "FitResult",
    "FitWarning",
    "FrequencyResponse",
    "Observation",
    "Parameter",
    "Reduction",
    "Replay",
    "ReplayRecording",
    "Response",
    "VoltagePlan",
]

FloatArray: TypeAlias = npt.NDArray[np.float64]

# What a FitResult has from the report as it is.
_REPORTED = ("r2_mean", "topology", "branches", "drive", "evaluations", "seconds", "interrupted", "structures", "relaxations")


class _Columns:
    """A dataclass with arrays of one length."""

    def columns(self) -> dict[str, npt.NDArray[Any]]:
        """The arrays by their names, for ``pandas.DataFrame``."""
        values = ((entry.name, getattr(self, entry.name)) for entry in fields(self))  # type: ignore[arg-type]
        return {name: value for name, value in values if isinstance(value, np.ndarray)}


@dataclass(frozen=True, repr=False)
class Response(_Columns):
    """The response of a model: every array has one value per step of the law.

    ``time_s`` (s), ``voltage_v`` (V; None where the input is no voltage), ``force_n`` (N, what drives the law) and
    ``displacement_m`` (m), at ``rate_hz`` steps per second.
    """

    time_s: FloatArray
    voltage_v: FloatArray | None
    force_n: FloatArray
    displacement_m: FloatArray
    rate_hz: float

    def __repr__(self) -> str:
        return f"<springpot.Response: {len(self.time_s)} samples at {self.rate_hz:g} Hz>"


@dataclass(frozen=True, repr=False)
class ReplayRecording(_Columns):
    """A recording beside the response of a model.

    ``r2`` (Eq. 14; NaN where the measurement does not change), ``nrmse_pct`` (% of peak to peak), ``rmse`` (m, or N where
    displacement drives) over ``samples`` measured values. ``time_s``, ``measured`` and ``modelled`` have one value per
    measured one; ``response`` has one per step.
    """

    file: str
    r2: float
    nrmse_pct: float
    rmse: float
    samples: int
    time_s: FloatArray
    measured: FloatArray
    modelled: FloatArray
    response: Response

    def __repr__(self) -> str:
        return f"<springpot.ReplayRecording {self.file!r}: R² {self.r2:.5f}, NRMSE {self.nrmse_pct:.3f} %>"


@dataclass(frozen=True)
class Replay:
    """Recordings beside the responses of a model, and the plain mean of their R²."""

    r2_mean: float
    recordings: list[ReplayRecording]

    def columns(self) -> dict[str, list[Any]]:
        """One row per recording, for ``pandas.DataFrame``."""
        names = ("file", "r2", "nrmse_pct", "rmse", "samples")
        return {name: [getattr(row, name) for row in self.recordings] for name in names}


@dataclass(frozen=True, repr=False)
class VoltagePlan(_Columns):
    """Voltages along a reference, one value per tick.

    ``voltage_v`` (V), ``displacement_m`` (m, of the model under it), ``reference_m`` (m, shaped) and ``limited`` (uint8, a set of
    bits: below zero 1, largest voltage 2, field 4, slew 8, velocity 16, acceleration 32, beyond the elastic curve 64, amplifier
    128). ``limits_met`` has the share of the time in % by limit.
    """

    time_s: FloatArray
    voltage_v: FloatArray
    displacement_m: FloatArray
    reference_m: FloatArray
    limited: npt.NDArray[np.uint8]
    limits_met: dict[str, float]
    rate_hz: float

    def __repr__(self) -> str:
        return f"<springpot.VoltagePlan: {len(self.time_s)} samples, up to {self.voltage_v.max():.0f} V>"


@dataclass(frozen=True, repr=False)
class Observation(_Columns):
    """The estimates of an observer over a recording, one value per tick.

    ``displacement_m`` is the estimate (m), ``sample_m`` the reading that arrived (m, NaN where none did), ``disturbance_n`` the
    force that the model does not know (N), ``force_scale`` its factor, ``innovation_m`` sensor minus prediction (m) with running mean and
    standard deviation. ``samples`` readings were used; ``innovation_rms_m`` is over all of them. ``bandwidth_hz`` is the observer's.
    """

    time_s: FloatArray
    voltage_v: FloatArray
    displacement_m: FloatArray
    sample_m: FloatArray
    disturbance_n: FloatArray
    force_scale: FloatArray
    innovation_m: FloatArray
    innovation_mean_m: FloatArray
    innovation_std_m: FloatArray
    bandwidth_hz: float
    samples: int
    innovation_rms_m: float

    def __repr__(self) -> str:
        return f"<springpot.Observation: {self.samples} readings, innovation {1e6 * self.innovation_rms_m:.2f} µm RMS>"


@dataclass(frozen=True, repr=False)
class FrequencyResponse(_Columns):
    """Displacement over force: ``frequency_hz`` (Hz), ``magnitude_m_per_n`` (m/N), ``phase_rad`` (rad, negative where displacement lags)."""

    frequency_hz: FloatArray
    magnitude_m_per_n: FloatArray
    phase_rad: FloatArray

    def __repr__(self) -> str:
        return f"<springpot.FrequencyResponse: {len(self.frequency_hz)} frequencies>"


@dataclass(frozen=True)
class Parameter:
    """A fitted value in SI units with its 95 % interval.

    ``low`` and ``high`` are of the profile likelihood, None where the recordings set no end. ``linear`` is the interval of the
    covariance, where there is one. ``at_bound`` says that the value is on the bound of what it may be.
    """

    name: str
    value: float
    low: float | None
    high: float | None
    linear: tuple[float, float] | None
    at_bound: bool


@dataclass(frozen=True)
class FitWarning:
    """A warning about a fit: ``severity`` is serious, caution or note."""

    severity: str
    text: str


@dataclass(frozen=True, repr=False)
class FitRecording(_Columns):
    """A recording beside the fitted model: as :class:`ReplayRecording`, with full memory at ``rate_hz`` (Hz).

    ``offset`` (m or N) and ``gain`` are its own, None where it shares those of the others.
    """

    file: str
    r2: float
    nrmse_pct: float
    rmse: float
    samples: int
    rate_hz: float
    offset: float | None
    gain: float | None
    time_s: FloatArray
    measured: FloatArray
    modelled: FloatArray

    def __repr__(self) -> str:
        return f"<springpot.FitRecording {self.file!r}: R² {self.r2:.5f}, NRMSE {self.nrmse_pct:.3f} %>"


@dataclass(frozen=True, repr=False)
class FitResult:
    """A fit: the model, how well it agrees, and how far its parameters are known.

    ``parameters`` is empty where no uncertainty was computed (pattern search, or a search that was ended early: then ``interrupted``).
    ``undetermined`` names sets of parameters that the recordings do not separate. ``structures`` has a dictionary for every structure that
    was compared, ``relaxations`` one for every branch, as ``fit --json`` prints them.
    """

    model: Model
    r2_mean: float
    recordings: list[FitRecording]
    parameters: list[Parameter]
    undetermined: list[str]
    warnings: list[FitWarning]
    topology: str
    branches: int
    curve: str
    drive: str
    evaluations: int
    seconds: float
    interrupted: bool
    structures: list[dict[str, Any]] = field(default_factory=list)
    relaxations: list[dict[str, Any]] = field(default_factory=list)
    report: dict[str, Any] = field(default_factory=dict)

    @classmethod
    def _from_report(
        cls, model: Model, text: str, series: list[tuple[FloatArray, FloatArray, FloatArray]], severities: list[str]
    ) -> FitResult:
        """The result of the document ``text`` that ``fit --json`` prints, with the series of every recording."""
        report = json.loads(text)
        uncertainty = report["uncertainty"] or {"estimates": [], "undetermined": []}
        rmse = "rmse_m" if report["drive"] == "force" else "rmse_n"
        kept = ("file", "samples", "rate_hz")
        return cls(
            model=model,
            recordings=[
                FitRecording(
                    # JSON has no NaN.
                    r2=float("nan") if row["r2"] is None else row["r2"],
                    nrmse_pct=float("nan") if row["nrmse_pct"] is None else row["nrmse_pct"],
                    rmse=row[rmse],
                    offset=row.get("offset"),
                    gain=row.get("gain"),
                    time_s=time_s,
                    measured=measured,
                    modelled=modelled,
                    **{name: row[name] for name in kept},
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

    def columns(self) -> dict[str, list[Any]]:
        """One row per parameter, for ``pandas.DataFrame``; an end that is open is infinite."""
        inf = float("inf")
        return {
            "name": [row.name for row in self.parameters],
            "value": [row.value for row in self.parameters],
            "low": [-inf if row.low is None else row.low for row in self.parameters],
            "high": [inf if row.high is None else row.high for row in self.parameters],
            "at_bound": [row.at_bound for row in self.parameters],
        }

    def to_dict(self) -> dict[str, Any]:
        """The document that ``fit --json`` prints: plain numbers, strings, lists and dictionaries."""
        return self.report

    def __repr__(self) -> str:
        early = ", ended early" if self.interrupted else ""
        return f"<springpot.FitResult: {self.topology} with n = {self.branches}, R² {self.r2_mean:.6f}{early}>"


@dataclass(frozen=True, repr=False)
class ClosedLoop(_Columns):
    """A controller on a simulated film: every array has one value per tick.

    ``time_s`` (s), the commanded ``voltage_v`` (V), ``displacement_m`` of the film and the shaped ``reference_m`` (m), the bits of the
    limits that were met (``limited``), and what the controller estimates: ``estimate_m`` (m), ``disturbance_n`` (N), ``force_scale``, NaN
    where it estimates nothing. ``quality`` is what ``closed-loop --json`` prints, such as ``tracking_rms_pct``.
    """

    time_s: FloatArray
    voltage_v: FloatArray
    displacement_m: FloatArray
    reference_m: FloatArray
    limited: npt.NDArray[np.uint8]
    estimate_m: FloatArray
    disturbance_n: FloatArray
    force_scale: FloatArray
    quality: dict[str, Any]
    rate_hz: float

    def __repr__(self) -> str:
        return f"<springpot.ClosedLoop {len(self.time_s)} ticks, {1e6 * self.quality['rms_m']:.3g} µm RMS>"


@dataclass(frozen=True)
class ComparedModel:
    """A model of creep in a comparison, with means over the recordings.

    ``left_out_nrmse_pct`` (%) is of every recording under a fit to the others, None for one recording; ``beyond_pct`` (%) the error after
    what was fitted, None where all was; ``step_ns`` (ns) the time of a step on this machine.
    """

    model: str
    family: str
    parameters: int
    r2_mean: float
    nrmse_pct: float
    left_out_nrmse_pct: float | None
    beyond_pct: float | None
    step_ns: float


@dataclass(frozen=True)
class Reduction:
    """A smaller model, the ``steps`` to it, and the largest relative change of the dynamic modulus."""

    model: Model
    steps: list[str]
    largest_change: float
