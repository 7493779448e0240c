"""Files that the tests share: made by the host tool, which is also what the package is compared with."""

from __future__ import annotations

import csv
import json
import os
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

ROOT = Path(__file__).resolve().parents[2]
Columns = dict[str, npt.NDArray[np.float64]]


class Tool:
    """The command line."""

    def __init__(self, program: Path, folder: Path) -> None:
        self.program = program
        self.folder = folder

    def run(self, *arguments: object) -> subprocess.CompletedProcess[str]:
        command = [str(self.program), *map(str, arguments)]
        return subprocess.run(command, cwd=self.folder, capture_output=True, text=True, check=False)

    def json(self, *arguments: object) -> Any:
        """The document that a command prints with ``--json``."""
        done = self.run(*arguments, "--json", "--quiet")
        assert done.returncode in (0, 1), done.stderr
        return json.loads(done.stdout)

    def refusal(self, *arguments: object) -> str:
        """The one line of a command that refuses."""
        done = self.run(*arguments, "--quiet")
        assert done.returncode == 2, done.stdout
        [line] = done.stderr.strip().splitlines()
        return line.removeprefix("springpot: ").removeprefix("error: ")


@pytest.fixture(scope="session")
def tool(tmp_path_factory: pytest.TempPathFactory) -> Tool:
    program = Path(os.environ.get("SPRINGPOT_HOST_SIM", ROOT / "target" / "release" / "host-sim"))
    if not program.exists():
        pytest.exit(f"{program} is missing: cargo build --release -p host-sim", returncode=2)
    return Tool(program.resolve(), tmp_path_factory.mktemp("bench"))


@pytest.fixture(scope="session")
def films(tool: Tool) -> list[Path]:
    """Two recordings of one film, 5 s and 7 s a cycle."""
    paths = []
    for name, frequency in (("film-5s.csv", 0.2), ("film-7s.csv", 1 / 7)):
        done = tool.run("plant", "--plant", "hossain", "--frequency", frequency, "--duration", 40, "--rate", 50, "--out", name)
        assert done.returncode == 0, done.stderr
        paths.append(tool.folder / name)
    return paths


@pytest.fixture(scope="session")
def fitted(tool: Tool, films: list[Path]) -> tuple[Path, Any]:
    """Parameters of that film, and what ``fit --json`` says of them."""
    report = tool.json("fit", *films, "--branches", 1, "--topology", "parallel", "--curve", "none", "--out", "film.toml")
    return tool.folder / "film.toml", report


@pytest.fixture(scope="session")
def sine(tool: Tool) -> Path:
    """A reference that the published film follows."""
    done = tool.run("reference", "--shape", "sine", "--low", "1.5mm", "--high", "2.5mm", "--period", 10, "--duration", 30, "--out", "sine.csv")
    assert done.returncode == 0, done.stderr
    return tool.folder / "sine.csv"


def read_csv(path: Path) -> Columns:
    """The columns of a table of the host tool, NaN where a cell is empty."""
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.reader(line for line in file if not line.startswith("#")))
    names, *cells = rows
    return {name: np.array([float(row[at] or "nan") for row in cells]) for at, name in enumerate(names)}


@pytest.fixture
def table(tool: Tool) -> Callable[..., Columns]:
    """Runs a command and reads the table that it writes."""

    def run(*arguments: object) -> Columns:
        done = tool.run(*arguments, "--out", "table.csv")
        assert done.returncode in (0, 1), done.stderr
        return read_csv(tool.folder / "table.csv")

    return run
