"""Films to be recorded: the simulated ones of the tool, two kinds that are integrated here, and a measured test.

Every film is at rest at the first row of a recording. Loads, displacements and forces are in SI units.
"""

import csv
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from math import log1p
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray
from scipy.special import gamma

jax.config.update("jax_enable_x64", True)

Array = NDArray[np.float64]

SEED = 1
RATE_HZ = 20.0
NOISE_M = 5e-6
STEP_S = 1e-3
FORCE_PER_V2 = 8.8541878128e-12 * 4.7 * 0.04 * 0.06 / 160e-6**2
"""Force per squared voltage of a film of the size that the tool assumes, N/V²."""


@dataclass(frozen=True)
class Recording:
    """Rows of `time_s`, `drive` (V, or m where the film is stretched) and `response` (m, or N): each of shape (rows,).

    Rows before `from_s` are not scored.
    """

    time_s: Array
    drive: Array
    response: Array
    stretched: bool = False
    from_s: float = 0.0

    @property
    def load(self) -> Array:
        """The squared voltage (V²) or the displacement (m), shape (rows,)."""
        return self.drive if self.stretched else self.drive**2

    def write(self, path: Path) -> Path:
        """Writes the recording as the tool reads it."""
        names = ("displacement_m", "force_n") if self.stretched else ("voltage_v", "displacement_m")
        rows = np.column_stack([self.time_s, self.drive, self.response])
        np.savetxt(path, rows, fmt="%.9g", delimiter=",", header=",".join(("time_s", *names)), comments="")
        return path


@dataclass(frozen=True)
class Case:
    """A film with the recordings that models are fitted to, and those that they have to predict, by split."""

    name: str
    training: list[Recording]
    tests: dict[str, list[Recording]]


Film = Callable[[float, float, Array], Array]
"""Displacement (m) at `time_s` (even, from 0) under V̂/2 (1 − cos 2πft), from V̂ (V), f (Hz) and `time_s`."""


def volts(peak_v: float, hz: float, time_s: Array) -> Array:
    """The voltage of a recording, V, of the shape of `time_s`."""
    return 0.5 * peak_v * (1.0 - jnp.cos(2.0 * jnp.pi * hz * time_s))


def stiffening(rng: np.random.Generator | None = None) -> Film:
    """A spring f = k₀ e + k₃ e³ in series with three Kelvin–Voigt elements, under a mass; constants at random with `rng`."""
    spring, cubic, coupling = 9e3, 6e8, 40.0
    stiffness, times_s = np.array([60e3, 50e3, 40e3]), np.array([0.3, 4.0, 40.0])
    if rng is not None:
        spring = 10 ** rng.uniform(3.8, 4.2)
        cubic = spring * rng.uniform(0.0, 1.5) / (30.0 / spring) ** 2
        coupling = rng.uniform(0.0, 60.0)
        stiffness = 3.0 * spring / rng.uniform(0.2, 1.2) / rng.uniform(0.5, 1.5, 3)
        times_s = rng.uniform(20.0, 100.0) * 10 ** (-rng.uniform(1.0, 3.0) * np.arange(3) / 3.0)
    mass, damping = 0.1, 0.3 * np.sqrt(0.1 * spring)

    def film(peak_v: float, hz: float, time_s: Array) -> Array:
        def slope(t: float, state: jax.Array) -> jax.Array:
            x, speed, flowed = state[0], state[1], state[2:]
            e = x - flowed.sum()
            force = spring * e + cubic * e**3
            pull = FORCE_PER_V2 * volts(peak_v, hz, t) ** 2 * (1.0 + coupling * x)
            return jnp.array([speed, (pull - force - damping * speed) / mass, *((force / stiffness - flowed) / times_s)])

        def step(state: jax.Array, t: float) -> tuple[jax.Array, jax.Array]:
            """The classical Runge–Kutta method; the displacement is that before the step."""
            a = slope(t, state)
            b = slope(t + 0.5 * STEP_S, state + 0.5 * STEP_S * a)
            c = slope(t + 0.5 * STEP_S, state + 0.5 * STEP_S * b)
            d = slope(t + STEP_S, state + STEP_S * c)
            return state + STEP_S / 6.0 * (a + 2.0 * (b + c) + d), state[0]

        every = round((time_s[1] - time_s[0]) / STEP_S)
        steps = STEP_S * jnp.arange(every * (len(time_s) - 1) + 1)
        return np.asarray(jax.lax.scan(step, jnp.zeros(5), steps)[1])[::every]

    return film


def springpot(rng: np.random.Generator | None = None) -> Film:
    """A springpot c D^α behind a logarithmic strain measure, beside a stiffening spring; constants at random with `rng`."""
    order, modulus, spring, cubic, length_m = 0.12, 6e3, 2e3, 5e7, 0.04
    if rng is not None:
        order, modulus = rng.uniform(0.06, 0.25), 10 ** rng.uniform(3.6, 4.0)
        spring, cubic, length_m = modulus * rng.uniform(0.1, 0.6), rng.uniform(0.0, 1e8), rng.uniform(0.02, 0.06)

    def film(peak_v: float, hz: float, time_s: Array) -> Array:
        force = FORCE_PER_V2 * volts(peak_v, hz, np.linspace(0.0, time_s[-1], 2 * len(time_s) - 1)) ** 2
        return behind_curves(force.tolist(), time_s[1] / 2.0, order, modulus, (spring, cubic), length_m)[::2]

    return film


def behind_curves(force: list[float], step_s: float, order: float, modulus: float, spring: tuple[float, float], length_m: float) -> Array:
    """Displacement (m) under `force` (N), both (steps,): F = k₀ x + k₃ x³ + T'(x) c D^α T(x), T = ℓ ln(1 + x/ℓ).

    The derivative is Caputo's by the L1 scheme over the whole past, which is not the tool's discretisation.
    """
    lags = np.arange(len(force) + 1.0)
    weights = np.diff(lags ** (1.0 - order)) * modulus * step_s**-order / gamma(2.0 - order)
    backwards, first = weights[::-1].copy(), float(weights[0])
    displacement, growth, x, strain = np.zeros(len(force)), np.zeros(len(force)), 0.0, 0.0
    for n in range(1, len(force)):
        past = float(backwards[-n:-1] @ growth[1:n]) if n > 1 else 0.0
        # Newton's method from the step before, whose error is squared each time.
        for _ in range(5):
            slope = 1.0 / (1.0 + x / length_m)
            stress = past + first * (length_m * log1p(x / length_m) - strain)
            excess = spring[0] * x + spring[1] * x**3 + slope * stress - force[n]
            x -= excess / (spring[0] + 3.0 * spring[1] * x**2 + slope**2 * (first - stress / length_m))
        new = length_m * log1p(x / length_m)
        displacement[n], growth[n], strain = x, new - strain, new
    return displacement


def run(tool: str, command: str, *files: Path) -> str:
    """Standard output of a command of the tool; its error ends the program."""
    done = subprocess.run([tool, *command.split(), *files], capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"{tool} {command.split()[0]}: {done.stderr.strip()}")
    return done.stdout


def of_the_tool(tool: str, name: str, folder: Path) -> Film:
    """The simulated film `name` of the tool, without noise."""

    def film(peak_v: float, hz: float, time_s: Array) -> Array:
        path = folder / "plant.csv"
        drive = f"--frequency {hz} --duration {time_s[-1]} --rate {RATE_HZ} --peak-voltage {peak_v}"
        run(tool, f"plant --plant {name} {drive} --noise 0 --quantum 0 --monitor-noise 0 --out", path)
        return table(path)["displacement_m"]

    return film


def recorded(name: str, film: Film, peak_v: float, training_s: float = 155.0, forecast_s: float = 1800.0) -> Case:
    """Three recordings for training, with noise, and five to be predicted, without it."""
    rng = np.random.default_rng(SEED)

    def record(share: float, hz: float, duration_s: float = training_s, noise_m: float = 0.0, from_s: float = 0.0) -> Recording:
        time_s = np.arange(round(duration_s * RATE_HZ) + 1) / RATE_HZ
        response = film(share * peak_v, hz, time_s) + noise_m * rng.standard_normal(len(time_s))
        return Recording(time_s, np.asarray(volts(share * peak_v, hz, time_s)), response, from_s=from_s)

    training = [record(share, hz, noise_m=NOISE_M) for share, hz in ((1.0, 1 / 5), (0.5, 1 / 7), (1.0, 1 / 13))]
    tests = {
        "forecast": [record(1.0, 1 / 13, forecast_s, from_s=training_s)],
        "amplitude": [record(share, 1 / 7) for share in (0.75, 1.2)],
        "frequency": [record(1.0, hz) for hz in (1 / 30, 1 / 3)],
    }
    return Case(name, training, tests)


def measured(path: Path) -> Case:
    """A tensile test (`time_s`, `stretch`, `nominal_stress_pa`) of a strip of 0.1 m × 10 mm²: the last third is to be predicted."""
    try:
        columns = table(path)
        time_s, stretch, stress = (columns[name] for name in ("time_s", "stretch", "nominal_stress_pa"))
        if len(time_s) < 100 or not np.diff(time_s).min() > 0.0 or not np.isfinite([stretch, stress]).all():
            raise ValueError("at least 100 rows in the order of time, without gaps")
    except (OSError, LookupError, ValueError) as error:
        raise SystemExit(f"{path}: not a tensile test with time_s, stretch, nominal_stress_pa: {error}") from None
    even_s = np.arange(time_s[0], time_s[-1], np.median(np.diff(time_s)))
    displacement, force = 0.1 * (np.interp(even_s, time_s, stretch) - 1.0), 1e-5 * np.interp(even_s, time_s, stress)
    time_s, until_s = even_s, time_s[0] + 2.0 / 3.0 * np.ptp(time_s)
    early = time_s <= until_s
    training = Recording(time_s[early], displacement[early], force[early], stretched=True)
    return Case(path.stem, [training], {"forecast": [Recording(time_s, displacement, force, True, until_s)]})


def table(path: Path) -> dict[str, Array]:
    """The columns of a CSV file by their names, each of shape (rows,)."""
    with open(path, newline="") as file:
        lines = [row for row in csv.reader(file) if row and not row[0].startswith("#")]
    rows = np.array([[float(cell or "nan") for cell in row] for row in lines[1:]])
    return dict(zip(lines[0], rows.T, strict=True))
