"""Types of the native part. The docstrings of classes and functions say shapes, units and errors."""

from collections.abc import Callable, Sequence
from os import PathLike
from typing import Any, Literal, TypeAlias, final, overload

import numpy as np
import numpy.typing as npt

from .limits import Limits

__version__: str

_Path: TypeAlias = str | PathLike[str]
_Array: TypeAlias = npt.NDArray[np.float64]
_Series: TypeAlias = npt.ArrayLike
_Element: TypeAlias = tuple[float, float]

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
    @property
    def relative_permittivity(self) -> float: ...
    @property
    def length_m(self) -> float: ...
    @property
    def width_m(self) -> float: ...
    @property
    def thickness_m(self) -> float: ...
    @property
    def mass_kg(self) -> float: ...
    @property
    def preload(self) -> Literal["settled", "from-start"]: ...
    @property
    def stretch_coupling(self) -> float: ...
    @property
    def saturation_v(self) -> float | None: ...
    @overload
    def force(self, voltage_v: float, displacement_m: float = 0.0) -> float: ...
    @overload
    def force(self, voltage_v: _Series, displacement_m: float = 0.0) -> _Array: ...
    @overload
    def voltage(self, force_n: float, displacement_m: float = 0.0) -> float: ...
    @overload
    def voltage(self, force_n: _Series, displacement_m: float = 0.0) -> _Array: ...

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
    @property
    def name(self) -> str: ...
    @property
    def topology(self) -> Literal["parallel", "eq11"]: ...
    @property
    def main(self) -> _Element: ...
    @property
    def branches(self) -> list[tuple[_Element, _Element]]: ...
    @property
    def actuator(self) -> Actuator: ...
    @property
    def sensor_offset_m(self) -> float: ...
    @property
    def sizes_assumed(self) -> bool: ...
    @property
    def curve(self) -> Literal["mooney-rivlin", "gent", "free"] | None: ...
    @overload
    def relaxation_modulus(self, time_s: float) -> float: ...
    @overload
    def relaxation_modulus(self, time_s: _Series) -> _Array: ...
    @overload
    def creep_compliance(self, time_s: float) -> float: ...
    @overload
    def creep_compliance(self, time_s: _Series) -> _Array: ...
    def __reduce__(self) -> tuple[Any, tuple[str, str]]: ...

@final
class Law:
    def __new__(
        cls,
        model: Model,
        rate_hz: float = 1000.0,
        *,
        method: Literal["gl", "bdf2"] = "gl",
        precision: Literal["f32", "f64"] = "f32",
    ) -> Law: ...
    @property
    def rate_hz(self) -> float: ...
    @property
    def method(self) -> Literal["gl", "bdf2"]: ...
    @property
    def precision(self) -> Literal["f32", "f64"]: ...
    @property
    def stiffness_n_per_m(self) -> float: ...
    @property
    def bound_per_stroke(self) -> float: ...
    def at_rest(self) -> State: ...
    def settled(self, force_n: float, duration_s: float) -> State: ...
    @overload
    def frequency_response(self, frequency_hz: float, at_m: float = 0.0) -> complex: ...
    @overload
    def frequency_response(self, frequency_hz: _Series, at_m: float = 0.0) -> npt.NDArray[np.complex128]: ...

@final
class State:
    @property
    def displacement_m(self) -> float: ...
    @property
    def beyond_curve(self) -> bool: ...
    @overload
    def displacement(self, force_n: float) -> float: ...
    @overload
    def displacement(self, force_n: _Series) -> _Array: ...
    @overload
    def force(self, displacement_m: float) -> float: ...
    @overload
    def force(self, displacement_m: _Series) -> _Array: ...
    def copy(self) -> State: ...

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
        name: str = "recording",
    ) -> Recording: ...
    @property
    def time_s(self) -> _Array: ...
    # None where there is no such column. `Any` spares a check in the programs of those who know that there is one.
    @property
    def voltage_v(self) -> _Array | Any: ...
    @property
    def force_n(self) -> _Array | Any: ...
    @property
    def displacement_m(self) -> _Array | Any: ...
    @property
    def weight(self) -> _Array | Any: ...
    @property
    def path(self) -> str: ...
    @property
    def duration_s(self) -> float: ...
    @property
    def understood(self) -> str | None: ...
    def save(self, path: _Path) -> None: ...
    def __len__(self) -> int: ...

@final
class Tick:
    @property
    def voltage_v(self) -> float: ...
    @property
    def reference_m(self) -> float | None: ...
    @property
    def displacement_m(self) -> float | None: ...
    @property
    def disturbance_n(self) -> float | None: ...
    @property
    def force_scale(self) -> float | None: ...
    @property
    def limited(self) -> list[str]: ...

@final
class Estimate:
    @property
    def displacement_m(self) -> float: ...
    @property
    def disturbance_n(self) -> float: ...
    @property
    def force_scale(self) -> float: ...
    @property
    def innovation_m(self) -> float: ...
    @property
    def innovation_std_m(self) -> float: ...

@final
class Tracking:
    def __new__(
        cls,
        model: Model,
        *,
        rate_hz: float = 1000.0,
        bandwidth_hz: float | None = None,
        adaptation_s: float | None = None,
        sensor_rate_hz: float = 100.0,
        sensor_delay_s: float = 0.01,
        harmonics: int | None = None,
        period_s: float | None = None,
        limits: Limits | None = None,
        precision: Literal["f32", "f64"] = "f32",
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

@final
class Feedforward:
    def __new__(
        cls,
        model: Model,
        *,
        rate_hz: float = 1000.0,
        limits: Limits | None = None,
        precision: Literal["f32", "f64"] = "f32",
    ) -> Feedforward: ...
    def tick(self, reference_m: float, *, applied_v: float | None = None, monitor_v: float | None = None) -> Tick: ...

@final
class Observer:
    def __new__(
        cls,
        model: Model,
        *,
        rate_hz: float = 1000.0,
        bandwidth_hz: float | None = None,
        adaptation_s: float | None = None,
        sensor_rate_hz: float = 100.0,
        sensor_delay_s: float = 0.01,
        max_voltage_v: float | None = None,
        precision: Literal["f32", "f64"] = "f32",
    ) -> Observer: ...
    def tick(self, voltage_v: float, sample_m: float | None = None, *, age_s: float | None = None) -> Estimate: ...

@final
class SimulatedFilm:
    def __new__(cls, plant: Literal["hossain", "wang"] = "hossain") -> SimulatedFilm: ...
    @property
    def displacement_m(self) -> float: ...
    def advance(self, voltage_v: float, duration_s: float) -> float: ...

@final
class Stage:
    @property
    def what(self) -> str: ...
    @property
    def number(self) -> int | None: ...
    @property
    def of(self) -> int | None: ...
    @property
    def share(self) -> float | None: ...

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
) -> Recording: ...
def read_reference(path: _Path, *, columns: str | None = None, sheet: str | None = None) -> Recording: ...
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

# Behind the functions of the package, which say what these take.
def simulate(
    model: Model, recording: Recording, rate_hz: float, memory: str, precision: str, method: str, drive: str
) -> dict[str, Any]: ...
def replay(
    model: Model,
    recordings: Sequence[Recording],
    drive: str,
    rate_hz: float,
    memory: str,
    precision: str,
    method: str,
) -> tuple[float, list[dict[str, Any]]]: ...
def feedforward(
    model: Model,
    reference: Recording,
    rate_hz: float,
    memory: str,
    precision: str,
    method: str,
    limits: dict[str, float] | None,
) -> dict[str, Any]: ...
def check_reference(
    model: Model, reference: Recording, rate_hz: float, method: str, limits: dict[str, float] | None
) -> str: ...
def observe(
    model: Model,
    recording: Recording,
    rate_hz: float,
    bandwidth_hz: float,
    adaptation_s: float,
    precision: str,
    method: str,
) -> dict[str, Any]: ...
def frequency_response(
    model: Model, from_hz: float, to_hz: float, points: int, at_m: float, law_hz: float | None
) -> list[_Array]: ...
def fit(
    recordings: Sequence[Recording],
    options: dict[str, object],
    progress: Callable[[Stage], bool | None] | None,
) -> tuple[Model, str, list[list[_Array]], list[str]]: ...
