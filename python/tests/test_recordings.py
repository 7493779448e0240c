"""Files of other programs, as ``import`` reads them."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import openpyxl
import pandas as pd
import pytest
import springpot as sp

from conftest import Tool, read_csv

TIME = np.arange(50) / 10
VOLTS = 3000 * (1 - np.cos(TIME))
MM = 0.25 * (1 - np.cos(TIME - 0.1))

DIALECTS = {
    "german.txt": ("Versuch 7\n\nZeit [s];Spannung [kV];Weg [mm]\n", ";", ",", "utf-16"),
    "tabs.dat": ("Time (s)\tVoltage (kV)\tDisplacement (mm)\n", "\t", ".", "latin-1"),
}


def rows(separator: str, sign: str) -> str:
    lines = (separator.join(f"{value:.6f}".replace(".", sign) for value in row) for row in zip(TIME, VOLTS / 1e3, MM, strict=True))
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("name", DIALECTS)
def test_dialects(tmp_path: Path, name: str) -> None:
    header, separator, sign, encoding = DIALECTS[name]
    (tmp_path / name).write_text(header + rows(separator, sign), encoding=encoding)
    recording = sp.read_recording(tmp_path / name)
    assert recording.understood is not None and "kV" in recording.understood
    # Six digits behind the point were written.
    assert np.allclose(recording.time_s, TIME, rtol=0, atol=1e-6)
    assert np.allclose(recording.voltage_v, VOLTS, rtol=0, atol=1e-3)
    assert np.allclose(recording.displacement_m, 1e-3 * MM, rtol=0, atol=1e-9)


def test_columns_and_edits_are_those_of_import(tool: Tool, tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("a,b,c\n" + rows(",", "."), encoding="utf-8")
    columns = 'time=1:s,voltage=b*2000,displacement=c:mm'
    done = tool.run("import", path, "--columns", columns, "--from", 1, "--to", 4, "--decimate", 2, "--blank", "displacement>0.4", "--out", "in")
    assert done.returncode == 0, done.stderr
    expected = read_csv(tool.folder / "in" / "log.csv")
    read = sp.read_recording(path, columns=columns, from_s=1, to_s=4, decimate=2, blank=["displacement>0.4"])
    assert np.array_equal(read.time_s, expected["time_s"])
    assert np.array_equal(read.voltage_v, expected["voltage_v"])
    assert np.isnan(read.displacement_m).any()
    assert np.array_equal(read.displacement_m, expected["displacement_m"], equal_nan=True)


def mat(path: Path, variables: dict[str, np.ndarray[tuple[int], np.dtype[np.float64]]]) -> None:
    """Columns as a file of MATLAB, version 5, after its written format: every element is a tag of type and bytes, padded to 8."""

    def element(kind: int, data: bytes) -> bytes:
        return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)

    out = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<HH", 0x0100, 0x4D49)
    for name, values in variables.items():
        # Class 6 is double; 6, 5, 1 and 9 are the types uint32, int32, int8 and double.
        flags, size = element(6, struct.pack("<II", 6, 0)), element(5, struct.pack("<ii", len(values), 1))
        out += element(14, flags + size + element(1, name.encode()) + element(9, values.astype("<f8").tobytes()))
    path.write_bytes(out)


def test_matlab(tmp_path: Path) -> None:
    mat(tmp_path / "run.mat", {"time_s": TIME, "voltage_v": VOLTS, "displacement_mm": MM})
    recording = sp.read_recording(tmp_path / "run.mat")
    assert np.array_equal(recording.time_s, TIME)
    assert np.array_equal(recording.voltage_v, VOLTS)
    assert np.array_equal(recording.displacement_m, MM * 1e-3)


def test_workbook(tmp_path: Path) -> None:
    book = openpyxl.Workbook()
    book.active.title = "notes"
    sheet = book.create_sheet("Run 1")
    sheet.append(["Time (s)", "Voltage (V)", "Displacement (mm)"])
    for row in zip(TIME, VOLTS, MM, strict=True):
        sheet.append([float(value) for value in row])
    book.save(tmp_path / "run.xlsx")
    recording = sp.read_recording(tmp_path / "run.xlsx", sheet="Run 1")
    # The workbook's writer keeps 16 digits.
    assert np.allclose(recording.voltage_v, VOLTS, rtol=1e-14, atol=0)


def test_references_need_no_voltage(tmp_path: Path) -> None:
    (tmp_path / "reference.csv").write_text("t [s];Soll [mm]\n0;0\n1;0,5\n2;0,7\n", encoding="utf-8")
    reference = sp.read_reference(tmp_path / "reference.csv", columns="displacement=2:mm")
    assert reference.displacement_m.tolist() == [0, 0.5e-3, 0.7e-3]


def test_saved_and_read_again(tmp_path: Path) -> None:
    mm = np.where(TIME > 3, np.nan, MM)
    recording = sp.Recording(TIME, voltage_v=VOLTS, displacement_m=1e-3 * mm)
    recording.save(tmp_path / "a.csv")
    again = sp.read_recording(tmp_path / "a.csv")
    assert np.array_equal(again.voltage_v, VOLTS)
    assert np.array_equal(again.displacement_m, 1e-3 * mm, equal_nan=True)
    assert again.understood is None and again.path == str(tmp_path / "a.csv")


def test_arguments_answer_what_errors_ask(tool: Tool, tmp_path: Path) -> None:
    """Each argument does what its option of ``import`` does."""
    lines = ["unit 7, gain 2", "a,b,c", *(f"{k // 2},{3000 - k},{k / 50}" for k in range(40))]
    (tmp_path / "log.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    columns = "time=a:s,voltage=b:V,displacement=c:mm"
    given = ["--columns", columns, "--header", 2, "--repeated-times", "spread", "--invert"]
    done = tool.run("import", tmp_path / "log.csv", *given, "--out", "in")
    assert done.returncode == 0, done.stderr
    expected = read_csv(tool.folder / "in" / "log.csv")
    read = sp.read_recording(tmp_path / "log.csv", columns=columns, header_line=2, repeated_times="spread", invert=True)
    assert np.array_equal(read.time_s, expected["time_s"])
    assert np.array_equal(read.displacement_m, expected["displacement_m"])
    assert not np.signbit(read.displacement_m[0]) and np.isclose(read.displacement_m[-1], -0.78e-3, rtol=1e-15)

    (tmp_path / "slow.csv").write_text("voltage_v;displacement_mm\n0;0,001\n;0,002\n20;0,003\n", encoding="utf-8")
    read = sp.read_recording(tmp_path / "slow.csv", rate_hz=10, fill="linear", decimal="comma")
    assert read.voltage_v.tolist() == [0, 10, 20] and read.time_s.tolist() == [0, 0.1, 0.2]
    held = sp.read_recording(tmp_path / "slow.csv", rate_hz=10, fill="hold", decimal="comma")
    assert held.voltage_v.tolist() == [0, 0, 20]

    parts = "time_s,displacement_mm\n0,1\n1,2\n2,3\n\ntime_s,displacement_mm\n0,4\n1,5\n2,6\n"
    (tmp_path / "parts.csv").write_text(parts, encoding="utf-8")
    second = sp.read_reference(tmp_path / "parts.csv", segment=2, invert=True)
    assert second.displacement_m.tolist() == [-4e-3, -5e-3, -6e-3]


def test_other_programs_read_what_is_written(tool: Tool, tmp_path: Path) -> None:
    """Written tables are read with the defaults of NumPy and pandas."""
    mm = np.where(TIME > 3, np.nan, MM)
    sp.Recording(TIME, voltage_v=VOLTS, displacement_m=1e-3 * mm).save(tmp_path / "a.csv")
    sine = ["--shape", "sine", "--period", 5, "--duration", 10, "--low", 0, "--high", 1e-3]
    for arguments in (["import", tmp_path / "a.csv", "--out", "in"], ["reference", *sine, "--out", "reference.csv"]):
        done = tool.run(*arguments)
        assert done.returncode == 0, done.stderr
    for path in (tmp_path / "a.csv", tool.folder / "in" / "a.csv", tool.folder / "reference.csv"):
        expected = read_csv(path)
        array = np.genfromtxt(path, delimiter=",", names=True)
        frame = pd.read_csv(path)
        assert list(array.dtype.names or ()) == list(frame.columns) == list(expected)
        for name, values in expected.items():
            assert np.array_equal(array[name], values, equal_nan=True), (path, name)
            # pandas reads decimals to within a rounding error by default.
            assert np.allclose(frame[name], values, rtol=1e-15, atol=0, equal_nan=True), (path, name)
