"""The examples of the documents run, and their types are right."""

from __future__ import annotations

import base64
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import nbclient
import nbformat
import pandas as pd
import pytest
import springpot as sp

from conftest import ROOT

PACKAGE = Path(sp.__file__).parent


def blocks(page: Path) -> list[tuple[str, str]]:
    """Blocks of Python in a page, each with what the page says it prints."""
    text = page.read_text(encoding="utf-8")
    found = re.findall(r"```python\n(.*?)```(?:\n+```text\n(.*?)```)?", text, re.DOTALL)
    return [(code, printed) for code, printed in found]


def test_the_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """The blocks of docs/python.md, one after the other in an empty folder, print what the page shows beneath them."""
    monkeypatch.chdir(tmp_path)
    scope: dict[str, Any] = {}
    shown = blocks(ROOT / "docs" / "python.md")
    assert len(shown) >= 5
    for code, printed in shown:
        assert len(code.strip().splitlines()) <= 14
        exec(compile(code, "docs/python.md", "exec"), scope)
        assert capsys.readouterr().out == printed


def test_the_page_names_everything() -> None:
    page = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")
    functions = {name for name in sp.__all__ if callable(getattr(sp, name)) and name[0].islower()}
    assert {name for name in functions if f"`{name}" not in page and f"sp.{name}" not in page} == set()


def test_the_notebook(tmp_path: Path) -> None:
    """From a CSV to figures; they are left in target/faces to be looked at."""
    notebook: Any = nbformat.read(ROOT / "python" / "examples" / "from_csv_to_figure.ipynb", as_version=4)  # type: ignore[no-untyped-call]
    assert not any(cell.get("outputs") for cell in notebook.cells), "commit it without outputs"
    nbclient.NotebookClient(notebook, timeout=600, kernel_name="python3", resources={"metadata": {"path": tmp_path}}).execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    figures = [output["data"]["image/png"] for output in outputs if "image/png" in output.get("data", {})]
    assert len(figures) == 3
    folder = ROOT / "target" / "faces"
    folder.mkdir(parents=True, exist_ok=True)
    for number, figure in enumerate(figures):
        (folder / f"notebook-{number}.png").write_bytes(base64.b64decode(figure))
    assert (tmp_path / "film.toml").exists()


def test_the_table_of_costs() -> None:
    """It runs; how long anything takes is not judged."""
    program = ROOT / "python" / "examples" / "cost.py"
    done = subprocess.run([sys.executable, program], capture_output=True, text=True, check=False)
    assert done.returncode == 0 and len(done.stdout.splitlines()) == 5, done.stderr


def mypy(*arguments: str | Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
        cwd=ROOT / "python",
        env={**os.environ, "MYPY_CACHE_DIR": str(ROOT / "target" / "faces" / "mypy")},
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_types_of_the_package_and_its_tests() -> None:
    mypy("mypy", "--strict", "-p", "springpot")
    mypy("mypy", "--strict", "tests", "examples")


def test_types_of_the_page(tmp_path: Path) -> None:
    """The page as one program passes the type checker."""
    (tmp_path / "page.py").write_text("\n".join(code for code, _ in blocks(ROOT / "docs" / "python.md")), encoding="utf-8")
    mypy("mypy", "--strict", tmp_path / "page.py")


def test_stubs_are_those_of_the_native_module(tmp_path: Path) -> None:
    """Names, arguments and defaults, in both directions; the list of names itself is not in the stubs."""
    assert (PACKAGE / "py.typed").exists()
    allowed = tmp_path / "allowed.txt"
    allowed.write_text("springpot._native.__all__\n", encoding="utf-8")
    mypy("mypy.stubtest", "springpot._native", "--allowlist", allowed)


def test_results_are_for_pandas(films: list[Path]) -> None:
    model = sp.load("preset:table3-n2")
    replay = sp.replay(model, films)
    frame = pd.DataFrame(replay.columns())
    assert list(frame.columns) == ["file", "r2", "nrmse_pct", "rmse", "samples"] and len(frame) == 2
    series = pd.DataFrame(replay.recordings[0].columns())
    assert list(series.columns) == ["time_s", "measured", "modelled"] and len(series) == replay.recordings[0].samples
    result = sp.fit(films[0], branches=0, topology="parallel", curve="none")
    parameters = pd.DataFrame(result.columns()).set_index("name")
    assert parameters.loc["main.alpha", "low"] < result.model.main[1] < parameters.loc["main.alpha", "high"]
    plain = result.to_dict()
    assert plain["recordings"][0]["r2"] == result.recordings[0].r2 and "model" not in plain
    # And back: a frame's columns are arrays.
    again = sp.Recording(series["time_s"], displacement_m=series["measured"])
    assert again.displacement_m is not None and len(again) == len(series)


def test_numpy_alone_is_needed() -> None:
    """A process that cannot import anything else of the environment."""
    program = (
        "import sys\n"
        "class Refuse:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name.split('.')[0] in {'matplotlib', 'pandas', 'scipy', 'pytest', 'nbformat'}:\n"
        "            raise ImportError(name)\n"
        "sys.meta_path.insert(0, Refuse())\n"
        "import springpot as sp\n"
        "sp.simulate(sp.load('preset:table3-n1'), sp.Recording([0, 1], voltage_v=[0, 1000]))\n"
        "print(sorted(name for name in sys.modules if name in {'matplotlib', 'pandas', 'scipy'}))\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout.strip()) == (0, "[]"), done.stderr
