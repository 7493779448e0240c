"""Models of dielectric elastomer films against each other: what they predict of films that they were fitted to, and what they cost.

    cargo xtask benchmark [--sample] [--measured TEST.csv]

Every model is fitted to the same three recordings of a film and then driven by the load alone, from rest: no measured response is fed
back. Training recordings have noise of 5 µm, the others none. Tables are Markdown on standard output, progress is on standard error.
"""

import argparse
import os
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median

import numpy as np
from scipy.special import gamma

import films
from films import SEED, Case, Recording
from models import BASELINES, Fitted, Tool, error_pct

SPLITS = ("training", "forecast", "amplitude", "frequency")
OURS = "this tool, defaults"


@dataclass
class Row:
    """A model on one film: mean error of each split (%), training time (processor, s) and the fitted model."""

    model: Fitted
    seconds: float
    errors: dict[str, float] = field(default_factory=dict)


def processor_s() -> float:
    """Processor time of this program and those that it ran, s, which depends little on what else the machine does."""
    return sum(os.times()[:4])


def row(fit: Callable[[list[Recording]], Fitted], case: Case) -> Row:
    """Fits a model to the training recordings of a film and predicts the others."""
    started = processor_s()
    done = Row(fit(case.training), processor_s() - started)
    for split, recordings in {"training": case.training, **case.tests}.items():
        done.errors[split] = float(np.mean([error_pct(done.model, recording) for recording in recordings]))
    return done


def rows(tool: Tool, case: Case) -> dict[str, Row]:
    """Every model on one film."""
    fits = {
        OURS: tool.fit,
        "this tool, Eq. 11, n = 2, no curve": lambda training: tool.fit(training, "--topology eq11 --branches 2 --curve none"),
        "Prony series, 3 branches": lambda training: tool.prony(training, 3),
        "Prony series, 5 branches": lambda training: tool.prony(training, 5),
        **BASELINES,
    }
    found = {}
    for name, fit in fits.items():
        found[name] = row(fit, case)
        errors = ", ".join(f"{split} {shown(error)}" for split, error in found[name].errors.items())
        print(f"{case.name}: {name} in {found[name].seconds:.1f} s: {errors} {found[name].model.structure}", file=sys.stderr)
    return found


def shown(error: float) -> str:
    """An error in %, with two digits after the point and none beyond 100."""
    return "diverges" if error > 1000.0 else f"{error:.2f}" if error < 99.5 else f"{error:.0f}"


def table(header: list[str], lines: list[list[str]]) -> None:
    """Prints a table in Markdown."""
    for cells in [header, ["---"] * len(header), *lines]:
        print(f"| {' | '.join(cells)} |")
    print()


def report(results: dict[str, dict[str, Row]]) -> None:
    """Prints medians and worst films, costs, the errors on each film, and where another model is better than ours."""
    names = list(next(iter(results.values())))
    simulated = [found for found in results.values() if set(SPLITS) <= set(found[OURS].errors)]
    lines = []
    for name in names if simulated else []:
        per_split = [[found[name].errors[split] for found in simulated] for split in SPLITS]
        lines.append([name, *(f"{shown(median(errors))}, {shown(max(errors))}" for errors in per_split)])
    table(["NRMSE, %: median, worst film", *SPLITS], lines)
    lines = []
    for name in names:
        models = [found[name].model for found in results.values()]
        costs = sorted({model.cost for model in models}, key=lambda cost: (len(cost), cost))
        numbers = [[model.parameters for model in models], [4 * model.numbers for model in models]]
        parameters, sizes = (f"{min(all)} to {max(all)}" if min(all) < max(all) else f"{min(all)}" for all in numbers)
        seconds = median(found[name].seconds for found in results.values())
        lines.append([name, parameters, f"{seconds:.2g}", " or ".join(costs), sizes])
    table(["model", "parameters", "training, s of processor", "multiply-adds a step", "bytes, f32"], lines)
    for split in SPLITS:
        having = {film: found for film, found in results.items() if split in found[OURS].errors}
        lines = [[name, *(shown(found[name].errors[split]) for found in having.values())] for name in names]
        table([f"{split}, NRMSE %", *having], lines)
    lines = []
    for film, found in results.items():
        for split, error in found[OURS].errors.items():
            best = min(found, key=lambda name: found[name].errors[split])
            if best != OURS:
                lines.append([film, split, shown(error), best, shown(found[best].errors[split])])
    table(["film", "split", OURS, "better", "its error"], lines)


def require(holds: bool, message: str) -> None:
    """Ends the program with a message where a figure cannot be right."""
    if not holds:
        raise SystemExit(message)


def check(results: dict[str, dict[str, Row]]) -> None:
    """The springpot film against its closed form, and the models' errors."""
    # A constant force on a springpot alone: x = F t^α / (c Γ(1 + α)).
    step_s, order = 0.05, 0.12
    times_s = step_s * np.arange(1, 2001)
    creep = films.behind_curves([1.0] * 2001, step_s, order, 6e3, (0.0, 0.0), 1e6)[1:]
    law = times_s**order / (6e3 * gamma(1.0 + order))
    off = float(np.abs(creep / law - 1.0)[100:].max())
    require(off < 1e-3, f"the springpot film is off by {off:.1e} from its closed form")
    for film, found in results.items():
        for name, done in found.items():
            require(done.errors["training"] < 50.0, f"{film}: {name} does not describe what it was fitted to: {done.errors}")
        for split, error in found[OURS].errors.items():
            static = found["static cubic"].errors[split]
            require(error < 0.5 * static, f"{film}, {split}: {error} % with the tool, {static} % without a memory")


def cases(tool: str, sample: bool, folder: Path) -> list[Case]:
    """The simulated films."""
    if sample:
        return [films.recorded("springpot", films.springpot(), 2800.0, training_s=40.0, forecast_s=200.0)]
    built_in = [films.recorded(name, films.of_the_tool(tool, name, folder), 6000.0) for name in ("hossain", "wang")]
    rng = np.random.default_rng(SEED)
    kinds = {"stiffening": films.stiffening, "springpot": films.springpot}
    own = [films.recorded(name, kind(), 2800.0) for name, kind in kinds.items()]
    random = [films.recorded(f"{name}, random", kind(rng), 2800.0) for name, kind in kinds.items()]
    return built_in + own + random


def main() -> None:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("tool", type=Path, help="the program springpot")
    parser.add_argument("--sample", action="store_true", help="one film and short recordings, in a minute")
    parser.add_argument("--measured", type=Path, metavar="TEST.csv", help="a tensile test: time_s, stretch, nominal_stress_pa")
    options = parser.parse_args()
    if not options.tool.is_file():
        parser.error(f"{options.tool}: not found; build it with cargo build --release -p host-sim")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        measured = [films.measured(options.measured)] if options.measured else []
        all_cases = measured + cases(str(options.tool), options.sample, folder)
        results = {case.name: rows(Tool(str(options.tool), folder), case) for case in all_cases}
    check(results)
    report(results)


if __name__ == "__main__":
    main()
