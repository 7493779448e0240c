"""Types of the native part. The docstrings of classes and functions say shapes, units and errors."""

from collections.abc import Callable, Iterable, Sequence
from os import PathLike
from pathlib import Path
from typing import Any, Final, Literal, TypeAlias, final, overload

import numpy as np
import numpy.typing as npt

from .limits import Limits
from .results import (
    ClosedLoop,
    ComparedModel,
    FitResult,
    FrequencyResponse,
    Observation,
    Reduction,
    Replay,
    Response,
    VoltagePlan,
)

__version__: str

_Path: TypeAlias = str | PathLike[str]
_Array: TypeAlias = npt.NDArray[np.float64]
_Series: TypeAlias = npt.ArrayLike
_Element: TypeAlias = tuple[float, float]
_Drive: TypeAlias = Literal["force", "displacement"]
_Method: TypeAlias = Literal["gl", "bdf2"]
_Precision: TypeAlias = Literal["f32", "f64"]
_Source: TypeAlias = Recording | _Path
_Sources: TypeAlias = _Source | Iterable[_Source]

@final
class Actuator:
    def __new__(
        cls,
        *,
        relative_permittivity: float = 4.7,
        length_m: float = 0.04,
        width_m: float = 0.06,
        thickness_m: float = 0.00016,
        mass_kg: float = 0.316,
        preload: Literal["settled", "from-start"] = "settled",
        stretch_coupling: float = 0.0,
        saturation_v: float | None = None,
    ) -> Actuator: ...
    relative_permittivity: Final[float]
    length_m: Final[float]
    width_m: Final[float]
    thickness_m: Final[float]
    mass_kg: Final[float]
    preload: Final[Literal["settled", "from-start"]]
    stretch_coupling: Final[float]
    saturation_v: Final[float | None]
    @overload
    def force(self, voltage_v: float, displacement_m: float = 0.0) -> float: ...
    @overload
    def force(self, voltage_v: _Series, displacement_m: float = 0.0) -> _Array: ...
    @overload
    def voltage(self, force_n: float, displacement_m: float = 0.0) -> float: ...
    @overload
    def voltage(self, force_n: _Series, displacement_m: float = 0.0) -> _Array: ...
    def __getnewargs_ex__(self) -> tuple[tuple[()], dict[str, Any]]: ...

@final
class Model:
    def __new__(
        cls,
        main: _Element,
        branches: Sequence[tuple[_Element, _Element]] = ...,
        *,
        topology: Literal["parallel", "eq11"] = "parallel",
        actuator: Actuator | None = None,
        sensor_offset_m: float = 0.0,
        name: str = "model",
    ) -> Model: ...
    @staticmethod
    def from_toml(text: str, source: str = "model") -> Model: ...
    def to_toml(self) -> str: ...
    name: Final[str]
    topology: Final[Literal["parallel", "eq11"]]
    main: Final[_Element]
    branches: Final[list[tuple[_Element, _Element]]]
    actuator: Final[Actuator]
    sensor_offset_m: Final[float]
    sizes_assumed: Final[bool]
    curve: Final[Literal["mooney-rivlin", "gent", "measure", "free"] | None]
    spring: Final[Literal["beside", "in series"] | None]
    @overload
    def relaxation_modulus(self, time_s: float) -> float: ...
    @overload
    def relaxation_modulus(self, time_s: _Series) -> _Array: ...
    @overload
    def creep_compliance(self, time_s: float) -> float: ...
    @overload
    def creep_compliance(self, time_s: _Series) -> _Array: ...
    reference_c: Final[float | None]
    def at_temperature(self, temperature_c: float) -> Model: ...
    def __reduce__(self) -> tuple[Any, tuple[str, str]]: ...

@final
class Law:
    def __new__(
        cls,
        model: Model,
        rate_hz: float,
        *,
        method: _Method = "gl",
        precision: _Precision = "f32",
    ) -> Law: ...
    rate_hz: Final[float]
    method: Final[Literal["gl", "bdf2"]]
    precision: Final[Literal["f32", "f64"]]
    stiffness_n_per_m: Final[float]
    bound_per_stroke: Final[float]
    def at_rest(self) -> State: ...
    def settled(self, force_n: float, duration_s: float) -> State: ...
    @overload
    def frequency_response(self, frequency_hz: float, at_m: float = 0.0) -> complex: ...
    @overload
    def frequency_response(self, frequency_hz: _Series, at_m: float = 0.0) -> npt.NDArray[np.complex128]: ...
    def __getnewargs_ex__(self) -> tuple[tuple[Model, float], dict[str, str]]: ...

@final
class State:
    displacement_m: Final[float]
    beyond_curve: Final[bool]
    @overload
    def displacement(self, force_n: float) -> float: ...
    @overload
    def displacement(self, force_n: _Series) -> _Array: ...
    @overload
    def force(self, displacement_m: float) -> float: ...
    @overload
    def force(self, displacement_m: _Series) -> _Array: ...
    def copy(self) -> State: ...
    def __copy__(self) -> State: ...

@final
class Recording:
    def __new__(
        cls,
        time_s: _Series,
        *,
        voltage_v: _Series | None = None,
        force_n: _Series | None = None,
        displacement_m: _Series | None = None,
        weight: _Series | None = None,
        temperature_c: _Series | None = None,
        name: str = "recording",
    ) -> Recording: ...
    time_s: Final[_Array]
    # None where there is no such column. `Any` spares a check in the programs of those who know that there is one.
    voltage_v: Final[_Array | Any]
    force_n: Final[_Array | Any]
    displacement_m: Final[_Array | Any]
    weight: Final[_Array | Any]
    temperature_c: Final[_Array | Any]
    path: Final[str]
    duration_s: Final[float]
    understood: Final[str | None]
    def save(self, path: _Path) -> None: ...
    def __getnewargs_ex__(self) -> tuple[tuple[_Array], dict[str, Any]]: ...
    def __len__(self) -> int: ...

@final
class Tick:
    voltage_v: Final[float]
    reference_m: Final[float | None]
    displacement_m: Final[float | None]
    disturbance_n: Final[float | None]
    force_scale: Final[float | None]
    ageing: Final[float | None]
    stiffness_change: Final[float | None]
    limited: Final[list[str]]

@final
class Estimate:
    displacement_m: Final[float]
    disturbance_n: Final[float]
    force_scale: Final[float]
    innovation_m: Final[float]
    innovation_std_m: Final[float]

@final
class Tracking:
    def __new__(
        cls,
        model: Model,
        rate_hz: float,
        *,
        bandwidth_hz: float | None = None,
        adaptation_s: float | None = None,
        sensor_rate_hz: float | None = None,
        sensor_delay_s: float | None = None,
        harmonics: int | None = None,
        period_s: float | None = None,
        adapts: bool = False,
        limits: Limits | None = None,
        precision: _Precision = "f32",
    ) -> Tracking: ...
    def tick(
        self,
        reference_m: float,
        sample_m: float | None = None,
        *,
        applied_v: float | None = None,
        monitor_v: float | None = None,
        age_s: float | None = None,
    ) -> Tick: ...
    def set_temperature(self, temperature_c: float) -> None: ...

@final
class Feedforward:
    def __new__(
        cls,
        model: Model,
        rate_hz: float,
        *,
        limits: Limits | None = None,
        precision: _Precision = "f32",
    ) -> Feedforward: ...
    def tick(self, reference_m: float, *, applied_v: float | None = None, monitor_v: float | None = None) -> Tick: ...

@final
class Observer:
    def __new__(
        cls,
        model: Model,
        rate_hz: float,
        *,
        bandwidth_hz: float | None = None,
        adaptation_s: float | None = None,
        sensor_rate_hz: float | None = None,
        sensor_delay_s: float | None = None,
        max_voltage_v: float | None = None,
        precision: _Precision = "f32",
    ) -> Observer: ...
    def tick(self, voltage_v: float, sample_m: float | None = None, *, age_s: float | None = None) -> Estimate: ...

@final
class SelfSensed:
    displacement_m: Final[float]
    age_s: Final[float]
    uncertainty_m: Final[float]
    capacitance_f: Final[float]
    resistance_ohm: Final[float]

@final
class SelfSensing:
    def __new__(cls, path: _Path) -> SelfSensing: ...
    rate_hz: Final[float]
    tone_v: Final[float]
    sensor_rate_hz: Final[float]
    sensor_delay_s: Final[float]
    @property
    def fault(self) -> Literal["no-tone", "shorted", "current-monitor", "electrode"] | None: ...
    def tick(self, voltage_v: float, current_a: float) -> SelfSensed | None: ...
    def drive(self, voltage_v: float) -> float: ...
    def correct(self, displacement_m: float, uncertainty_m: float, *, age_s: float = 0.0) -> None: ...

@final
class SimulatedFilm:
    def __new__(cls, plant: Literal["hossain", "wang"] = "hossain") -> SimulatedFilm: ...
    displacement_m: Final[float]
    def advance(self, voltage_v: float, duration_s: float) -> float: ...

@final
class Stage:
    what: Final[str]
    number: Final[int | None]
    of: Final[int | None]
    share: Final[float | None]

@final
class Link:
    def __new__(cls, port: str) -> Link: ...
    def identify(self) -> dict[str, Any]: ...
    def status(self) -> dict[str, Any]: ...
    def upload(self, model: Model, *, rate_hz: float = 1000.0, bench: bool = False, keep: bool = True) -> None: ...
    def arm(self) -> None: ...
    def start(self, mode: Literal["voltage", "feedforward", "tracking"]) -> None: ...
    def set_voltage(self, voltage_v: float) -> None: ...
    def set_reference(self, reference_m: float) -> None: ...
    def heartbeat(self) -> None: ...
    def stop(self) -> None: ...
    def disarm(self) -> None: ...
    def acknowledge(self) -> None: ...
    def stream(self, every: int) -> None: ...
    def samples(self, duration_s: float) -> list[dict[str, Any]]: ...
    def __enter__(self) -> Link: ...
    def __exit__(self, _kind: object, _value: object, _traceback: object) -> None: ...

def load(path: _Path) -> Model: ...
def save(model: Model, path: _Path) -> None: ...
def presets() -> list[str]: ...
def read_recording(
    path: _Path,
    *,
    columns: str | None = None,
    sheet: str | None = None,
    from_s: float = 0.0,
    to_s: float | None = None,
    decimate: int = 1,
    blank: Sequence[str] = ...,
    header_line: int | None = None,
    segment: int | None = None,
    decimal: Literal["point", "comma"] | None = None,
    repeated_times: Literal["spread", "mean"] | None = None,
    fill: Literal["hold", "linear"] | None = None,
    rate_hz: float | None = None,
    invert: bool = False,
) -> Recording: ...
def read_reference(
    path: _Path,
    *,
    columns: str | None = None,
    sheet: str | None = None,
    header_line: int | None = None,
    segment: int | None = None,
    decimal: Literal["point", "comma"] | None = None,
    repeated_times: Literal["spread", "mean"] | None = None,
    rate_hz: float | None = None,
    invert: bool = False,
) -> Recording: ...
def record_film(
    plant: Literal["hossain", "wang"] = "hossain",
    *,
    frequency_hz: Sequence[float] = ...,
    duration_s: float = 60.0,
    rate_hz: float = 100.0,
    peak_voltage_v: float = 6000.0,
    seed: int = 1,
    name: str = "film",
) -> Recording: ...
def reference(
    shape: Literal["sine", "triangle", "steps", "random-walk"],
    *,
    low_m: float,
    high_m: float,
    period_s: float,
    duration_s: float = 155.0,
    rate_hz: float = 1000.0,
    rise_s: float | None = None,
    seed: int = 1,
) -> Recording: ...
def simulate(
    model: Model,
    recording: _Source,
    *,
    rate_hz: float = 1000.0,
    memory: str = "compressed",
    precision: _Precision = "f32",
    method: _Method = "gl",
    drive: _Drive = "force",
) -> Response: ...
def replay(
    model: Model,
    recordings: _Sources,
    *,
    drive: _Drive = "force",
    rate_hz: float = 1000.0,
    memory: str = "compressed",
    precision: _Precision = "f32",
    method: _Method = "gl",
) -> Replay: ...
def feedforward(
    model: Model,
    reference: _Source,
    *,
    rate_hz: float = 1000.0,
    memory: str = "compressed",
    precision: _Precision = "f32",
    method: _Method = "gl",
    limits: Limits | None = None,
) -> VoltagePlan: ...
def check_reference(
    model: Model, reference: _Source, *, rate_hz: float = 1000.0, method: _Method = "gl", limits: Limits | None = None
) -> dict[str, Any]: ...
def observe(
    model: Model,
    recording: _Source,
    *,
    rate_hz: float = 1000.0,
    bandwidth_hz: float | None = None,
    adaptation_s: float = 30.0,
    precision: _Precision = "f32",
    method: _Method = "gl",
) -> Observation: ...
def frequency_response(
    model: Model, from_hz: float, to_hz: float, points: int = 200, *, at_m: float = 0.0, law_hz: float | None = None
) -> FrequencyResponse: ...
def fit(
    recordings: _Sources,
    *,
    branches: int | Literal["auto"] | None = None,
    topology: Literal["eq11", "parallel", "auto"] = "auto",
    curve: Literal["auto", "none", "saturation", "mooney-rivlin", "gent", "free", "both", "two"] = "auto",
    method: Literal["lm", "pattern-search"] = "lm",
    drive: _Drive = "force",
    free: Sequence[str] = ...,
    hold: Sequence[str] = ...,
    actuator: Actuator | Model | _Path | None = None,
    start: Model | None = None,
    loss: Literal["square", "huber"] = "square",
    weights: Sequence[float] | Literal["log-time"] | None = None,
    offset: Literal["joint", "per-recording"] = "joint",
    gain: Literal["joint", "per-recording"] = "joint",
    sensor_delay_s: float | None = None,
    gap_s: float | None = None,
    at_gap: Literal["end", "skip"] = "end",
    invert: bool = False,
    from_s: float = 0.0,
    to_s: float | None = None,
    seed: int = 1,
    starts: int = 8,
    progress: Callable[[Stage], bool | None] | None = None,
) -> FitResult: ...
def closed_loop(
    model: Model,
    reference: _Source,
    *,
    film: Literal["hossain", "wang"] | Model = "hossain",
    controller: Literal["none", "static", "window", "pi", "feedforward", "tracking"] = "tracking",
    rate_hz: float = 1000.0,
    bandwidth_hz: float | None = None,
    adaptation_s: float | None = None,
    harmonics: int | None = None,
    period_s: float | None = None,
    limits: Limits | None = None,
    precision: _Precision = "f32",
    seed: int = 1,
    sensor_rate_hz: float | None = None,
    sensor_delay_s: float | None = None,
    sensor_noise_m: float = 5e-06,
    sensor_quantum_m: float = 1e-06,
    sensor_lost_s: Sequence[tuple[float, float]] = (),
    amplifier_lag_s: float = 0.0,
    amplifier_bleeder_s: float = 0.0,
    monitor_error: float | None = None,
    stiffness: float = 1.0,
    alpha: float = 1.0,
) -> ClosedLoop: ...
def compare(
    recordings: _Sources,
    *,
    drive: _Drive = "force",
    actuator: Actuator | Model | _Path | None = None,
    to_s: float | None = None,
    seed: int = 1,
    starts: int = 8,
    progress: Callable[[Stage], bool | None] | None = None,
) -> list[ComparedModel]: ...
def reduce(model: Model, *, from_hz: float = 1e-06, to_hz: float = 10000.0, tolerance: float = 1e-09) -> Reduction: ...
def export(
    model: Model,
    path: _Path,
    *,
    rate_hz: float = 1000.0,
    emit: Literal["blob", "rust", "c", "arduino", "sfunction", "fmu", "fmu2"] | None = None,
    method: _Method = "gl",
) -> list[Path]: ...
