"""Other models of films, and this project's tool, behind one interface: fitted to recordings, then driven by the load alone."""

import json
import re
import tomllib
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from fastcan.narx import make_narx
from flax import linen as nn
from fracmem import CompressedFractionalFilter
from jax.flatten_util import ravel_pytree
from scipy.optimize import lsq_linear, minimize, minimize_scalar
from scipy.signal import fftconvolve

from films import FORCE_PER_V2, SEED, Array, Recording, run, table


@dataclass(frozen=True)
class Fitted:
    """A model after its fit, with its cost on a controller: multiply-adds a step, and numbers of 4 bytes for constants and state."""

    predict: Callable[[Recording], Array]
    parameters: int
    cost: str
    numbers: int
    structure: str = ""


Fit = Callable[[list[Recording]], Fitted]


def error_pct(model: Fitted, recording: Recording) -> float:
    """NRMSE of the prediction on the rows that are scored: RMS error in % of the peak to peak; infinite if it diverges."""
    scored = recording.time_s >= recording.from_s
    with np.errstate(all="ignore"):
        difference = (model.predict(recording) - recording.response)[scored]
        error = 100.0 * np.sqrt(np.mean(difference**2)) / np.ptp(recording.response[scored])
    return float(error) if np.isfinite(error) else np.inf


def chosen(candidates: Iterable[Fit], training: list[Recording]) -> Fitted:
    """The candidate that predicts the last recording best from the others, or the end of a single one from its beginning, fitted to all."""
    if len(training) > 1:
        early, late = training[:-1], training[-1]
    else:
        [whole] = training
        rows = round(0.7 * len(whole.time_s))
        begin = [series[:rows] for series in (whole.time_s, whole.drive, whole.response)]
        early, late = [Recording(*begin, whole.stretched)], replace(whole, from_s=whole.time_s[rows])
    return min(candidates, key=lambda fit: error_pct(fit(early), late))(training)


def scales(training: list[Recording]) -> tuple[float, float]:
    """The largest load and response of the recordings, by which they are divided."""
    return max(np.abs(r.load).max() for r in training), max(np.abs(r.response).max() for r in training)


def powers(load: Array) -> Array:
    """1, u, u², u³: shape (4, rows)."""
    return load ** np.arange(4.0)[:, None]


def static_map(training: list[Recording]) -> Fitted:
    """A cubic polynomial of the load, which a static inverse inverts."""
    largest, _ = scales(training)
    basis = np.hstack([powers(r.load / largest) for r in training])
    values = np.linalg.lstsq(basis.T, np.hstack([r.response for r in training]))[0]
    return Fitted(lambda r: values @ powers(r.load / largest), 4, "4", 4)


OPERATORS = 10


def prandtl_ishlinskii(training: list[Recording]) -> Fitted:
    """A cubic polynomial and play operators whose thresholds widen with the rate of the load (Zou and Gu 2018, Polymers 10, 525)."""
    largest, _ = scales(training)

    def basis(r: Recording, widening_s: float) -> Array:
        u, plays = r.load / largest, np.zeros((len(r.load), OPERATORS))
        rates = np.abs(np.diff(u, prepend=u[0])) / (r.time_s[1] - r.time_s[0])
        thresholds = np.arange(1.0, OPERATORS + 1.0) / (OPERATORS + 1.0) + widening_s * rates[:, None]
        for k in range(1, len(u)):
            plays[k] = np.maximum(u[k] - thresholds[k], np.minimum(u[k], plays[k - 1]))
        return np.vstack([powers(u), plays.T])

    measured = np.hstack([r.response for r in training])
    # Displacements lag behind the load, forces lead.
    lower = np.array([-np.inf] * 4 + [-np.inf if training[0].stretched else 0.0] * OPERATORS)
    upper = np.array([np.inf] * 4 + [0.0 if training[0].stretched else np.inf] * OPERATORS)

    def solved(widening_s: float) -> tuple[float, float, Array]:
        found = lsq_linear(np.hstack([basis(r, widening_s) for r in training]).T, measured, (lower, upper))
        return found.cost, widening_s, found.x

    _, widening_s, values = min((solved(s) for s in (0.0, 0.01, 0.03, 0.1, 0.3, 1.0)), key=lambda found: found[0])
    return Fitted(lambda r: values @ basis(r, widening_s), OPERATORS + 5, str(OPERATORS + 5), 2 * OPERATORS + 6)


HEAD, MODES = 12, 36


def fracmem(training: list[Recording]) -> Fitted:
    """One fractional operator behind a cubic polynomial of the load, run by fracmem with as many numbers as this project's memory."""
    largest, _ = scales(training)
    step_s = float(training[0].time_s[1] - training[0].time_s[0])
    stretched = training[0].stretched
    measured = np.hstack([r.response for r in training])

    def basis(r: Recording, order: float) -> Array:
        """1, and D^±α of u, u², u³ with the whole memory: forces from displacements, or displacements from forces."""
        exponent = order if stretched else -order
        weights = np.cumprod(np.concatenate([[1.0], 1.0 - (1.0 + exponent) / np.arange(1.0, len(r.load))]))
        rows = powers(r.load / largest)
        return np.vstack([rows[:1], step_s**-exponent * fftconvolve(rows[1:], weights[None], axes=1)[:, : len(r.load)]])

    def solved(order: float) -> tuple[Array, float]:
        columns = np.hstack([basis(r, order) for r in training]).T
        values = np.linalg.lstsq(columns, measured)[0]
        return values, float(np.sum((columns @ values - measured) ** 2))

    order = minimize_scalar(lambda order: solved(order)[1], bounds=(0.005, 0.6), method="bounded").x
    values = solved(order)[0]
    # Its own fit to signals of the recordings' length does not hold for half an hour.
    memory = CompressedFractionalFilter.from_analytic(order, step_s, HEAD, MODES, j_max=40_000)

    def predict(r: Recording) -> Array:
        cubic = values[1:] @ powers(r.load / largest)[1:]
        return values[0] + (memory.predict(cubic) if stretched else inverse(memory, cubic))

    return Fitted(predict, 5, str(HEAD + 2 * MODES + 4), 2 * HEAD + 3 * MODES + 5)


def inverse(memory: CompressedFractionalFilter, output: Array) -> Array:
    """The input of fracmem's operator whose output is given, sample by sample, both of shape (rows,)."""
    scale = memory.h**-memory.alpha
    weights = scale * np.cumprod(np.concatenate([[1.0], 1.0 - (1.0 + memory.alpha) / np.arange(1.0, memory.L)]))
    head, modes, found = np.zeros(memory.L), np.zeros(memory.p), np.zeros(len(output))
    for k, value in enumerate(output):
        modes = memory.lam * modes + head[-1]
        head = np.roll(head, 1)
        head[0] = found[k] = (value - weights[1:] @ head[1:] - memory.c @ modes) / weights[0]
    return found


def narx(training: list[Recording], terms: int, delay: int, degree: int) -> Fitted:
    """A polynomial of the last loads and of its own last outputs, fitted to its own simulation over each whole recording."""
    load, size = scales(training)
    inputs = np.hstack([r.load for r in training])[:, None] / load
    outputs = np.hstack([r.response for r in training]) / size
    sessions = [len(r.load) for r in training]
    model = make_narx(inputs, outputs, terms, delay, poly_degree=degree, session_sizes=sessions, verbose=0)
    model.fit(inputs, outputs, coef_init="one_step_ahead", session_sizes=sessions, max_nfev=20)
    return Fitted(lambda r: size * model.predict(r.load[:, None] / load), terms + 1, str(degree * terms), terms + 1 + 2 * delay)


class Recurrent(nn.Module):
    """A layer of gated recurrent units and a linear output of it and of the load; (batch, rows, 1) to (batch, rows)."""

    units: int

    @nn.compact
    def __call__(self, load: jax.Array) -> jax.Array:
        """The response to the load from rest."""
        states = nn.RNN(nn.GRUCell(self.units, param_dtype=float, name="memory"))(load)
        return nn.Dense(1, param_dtype=float)(jnp.concatenate([states, load], axis=-1))[..., 0]


def recurrent(training: list[Recording], units: int, steps: int) -> Fitted:
    """A recurrent network, fitted to its simulation of whole recordings by L-BFGS; its gates begin with memories of 0.1 to 100 s."""
    load, size = scales(training)
    inputs = jnp.stack([r.load for r in training])[..., None] / load
    outputs = jnp.stack([r.response for r in training]) / size
    network = Recurrent(units)
    start = network.init(jax.random.key(SEED), inputs[:, :2])
    rows = jnp.geomspace(0.1, 100.0, units) / float(training[0].time_s[1] - training[0].time_s[0])
    start["params"]["memory"]["iz"]["bias"] = jnp.log(rows)
    flat, unflatten = ravel_pytree(start)
    loss = jax.jit(jax.value_and_grad(lambda values: jnp.mean((network.apply(unflatten(values), inputs) - outputs) ** 2)))
    options = {"maxiter": steps, "maxcor": 30, "ftol": 0.0, "gtol": 1e-10}
    values = unflatten(minimize(loss, flat, jac=True, method="L-BFGS-B", options=options).x)
    products = 3 * units * (units + 1) + 3 * units + units + 1

    def predict(r: Recording) -> Array:
        return size * np.asarray(network.apply(values, jnp.asarray(r.load)[None, :, None] / load))[0]

    return Fitted(predict, len(flat), str(products), len(flat) + units)


NARX = ((5, 2, 1), (8, 6, 2), (14, 2, 3))
"""Terms, rows of delay and degree."""

BASELINES: dict[str, Callable[[list[Recording]], Fitted]] = {
    "static cubic": static_map,
    "Prandtl–Ishlinskii, rate-dependent": prandtl_ishlinskii,
    "fracmem behind a cubic": fracmem,
    "NARX": lambda training: chosen((partial(narx, terms=n, delay=d, degree=g) for n, d, g in NARX), training),
    "recurrent network": lambda training: chosen((partial(recurrent, units=n, steps=200) for n in (4, 8)), training),
}


LAW_BYTES = 816 + 424
"""A law and its state in f32, as docs/results.md has them."""


def instructions(drive: str, kind: str) -> str:
    """Instructions of a step on a Cortex-M4F, from the table of docs/results.md."""
    page = (Path(__file__).parents[2] / "docs" / "results.md").read_text()
    name = re.escape(f"| `{'relaxation' if drive else 'creep'}/{HEAD}+{MODES}{kind}` | ")
    return re.search(name + "([0-9 ]+) ", page)[1]


@dataclass(frozen=True)
class Tool:
    """Fits of this project's tool, whose files are in `folder`."""

    program: str
    folder: Path

    def fit(self, training: list[Recording], options: str = "") -> Fitted:
        """A fit with `options`; it is run as a controller would at 100 Hz: compressed memory, f32, second order."""
        parameters = self.folder / "film.toml"
        drive = "--drive displacement" if training[0].stretched else ""
        files = [r.write(self.folder / f"{k}.csv") for k, r in enumerate(training)]
        report = json.loads(run(self.program, f"fit --json {drive} {options} --out {parameters}", *files))
        text = parameters.read_text()
        film = tomllib.loads(text)

        def predict(r: Recording) -> Array:
            parameters.write_text(text)
            answer, row = self.folder / "answer", r.write(self.folder / "row.csv")
            run(self.program, f"replay --json {drive} --rate 100 --method bdf2 --params {parameters} --out {answer}", row)
            columns = table(answer / row.name)
            if r.stretched:
                return np.interp(r.time_s - r.time_s[0], columns["time_s"], columns["force_n"])
            delay_s, offset_m = (film.get("sensor", {}).get(name, 0.0) for name in ("delay_s", "offset_m"))
            return offset_m + np.interp(r.time_s - r.time_s[0] - delay_s, columns["time_s"], columns["displacement_m"])

        curve = report["film"]["curve"]
        structure = f"{report['topology']} n = {report['branches']}, {curve}"
        kinds = {"linear": "", "two curves": "+curves", "spring in series": "+series"}
        kind = next((kind for name, kind in kinds.items() if curve.startswith(name)), "+curve")
        cost = f"{HEAD + 2 * MODES} ({instructions(drive, kind)} instructions)"
        return Fitted(predict, len(report["uncertainty"]["estimates"]), cost, LAW_BYTES // 4, structure)

    def prony(self, training: list[Recording], branches: int) -> Fitted:
        """Springs and dashpots, from relaxation times between 0.1 s and the length of the recordings, and two shares of creep."""
        load, response = scales(training)
        stretched = training[0].stretched
        stiffness = response / load if stretched else FORCE_PER_V2 * load / response
        times_s = np.geomspace(0.1, training[0].time_s[-1], branches + 2)[1:-1]
        held = "--hold main.alpha " + "".join(f"--hold branches[{k}][{j}].alpha " for k in range(branches) for j in (0, 1))

        def start(share: float) -> Fitted:
            rows = ",".join(
                f"[{{ c = {share * stiffness}, alpha = 0.0 }}, {{ c = {share * stiffness * time_s}, alpha = 1.0 }}]" for time_s in times_s
            )
            path = self.folder / "start.toml"
            path.write_text(PRONY.format(mass=0.0 if stretched else 0.316, stiffness=stiffness, branches=rows))
            return self.fit(training, f"--start {path} --curve none {held}")

        models = [start(share) for share in (0.2, 1.0)]
        best = min(models, key=lambda model: sum(error_pct(model, r) for r in training))
        return Fitted(best.predict, best.parameters, str(2 * branches + 4), 3 * branches + 5)


PRONY = """schema = 1
name = "Prony series"
[actuator]
relative_permittivity = 4.7
length_m = 0.04
width_m = 0.06
thickness_m = 160e-6
mass_kg = {mass}
[model]
topology = "parallel"
main = {{ c = {stiffness}, alpha = 0.0 }}
branches = [{branches}]
"""
