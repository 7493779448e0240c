"""Writes the binary files of this folder: scipy for .mat, openpyxl for .xlsx, h5py for version 7.3 of .mat.

    pip install scipy==1.17.1 openpyxl==3.1.5 h5py
    python make.py

The numbers are those of `Sample` in host-sim/io/tests/it/lab_files.rs.
"""

import datetime
import pathlib
import tempfile
import zipfile

import h5py
import numpy
import openpyxl
import scipy.io

HERE = pathlib.Path(__file__).parent
k = numpy.arange(24.0)
time_s = k / 8
voltage_kv = 0.0125 * k * k
laser_mm = 0.05 + 0.003 * k * k


def mat(name, variables, **options):
    scipy.io.savemat(HERE / name, variables, **options)


vectors = {"time_s": time_s, "voltage_kV": voltage_kv, "laser_mm": laser_mm}
mat("vectors.mat", vectors, do_compression=False)
mat("compressed.mat", vectors, do_compression=True, oned_as="column")
mat("bare-names.mat", {"t": time_s, "V": 1000 * voltage_kv, "x": laser_mm, "operator": "AB", "rate": 8.0})
mat("structure.mat", {"run": {"Time_s": time_s, "HV_kV": voltage_kv, "Laser_mm": laser_mm, "note": "third film"}})
mat("matrix.mat", {"data": numpy.column_stack([time_s, voltage_kv, laser_mm])}, do_compression=True)
mat("integers.mat", {"time_ms": (1000 * time_s).astype("int32"), "voltage_V": (1000 * voltage_kv).astype("float32"),
                     "laser_um": laser_mm * 1000})
mat("two-voltages.mat", {**vectors, "hv_set_kV": voltage_kv})
mat("lengths.mat", {**vectors, "laser_mm": laser_mm[:20]})

mat("rows.mat", {"data": numpy.vstack([time_s, voltage_kv, laser_mm]), "phase": laser_mm * 1j}, do_compression=True)
mat("version-4.mat", vectors, format="4")


def mat_hdf5(name, variables):
    """As MATLAB does: two sizes in the reverse order, old groups, chunks that are compressed, 512 bytes before it all."""

    def put(group, name, values, kind="double", **options):
        group.create_dataset(name, data=numpy.atleast_2d(values), **options).attrs["MATLAB_class"] = numpy.bytes_(kind)

    with h5py.File(HERE / name, "w", userblock_size=512, libver="earliest") as file:
        for key, values in variables.items():
            if isinstance(values, dict):
                group = file.create_group(key)
                group.attrs["MATLAB_class"] = numpy.bytes_("struct")
                for field, column in values.items():
                    put(group, field, column, chunks=(1, len(column)), compression=9)
            else:
                put(file, key, values, {"i": "int32", "u": "char", "V": "double", "f": "double"}[values.dtype.kind])
        put(file, "operator", numpy.array([65, 66], "uint16"), "char")
        put(file, "runs", numpy.arange(6, dtype="uint32"), "table")
        put(file, "phase", numpy.array([(0, 1)] * 24, dtype=[("real", "f8"), ("imag", "f8")]))
        file.create_group("#refs#")["a"] = laser_mm
    with open(HERE / name, "r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Mon Nov 23 2026".ljust(124) + b"\0\2IM")


mat_hdf5("version-7.3.mat", {"run": {"Time_s": time_s, "HV_kV": voltage_kv, "Laser_mm": laser_mm}})
mat_hdf5("matrix-7.3.mat", {"data": numpy.vstack([time_s, voltage_kv, laser_mm])})
mat_hdf5("integers-7.3.mat", {"time_ms": (1000 * time_s).astype("int32"), "voltage_V": 1000 * voltage_kv, "laser_um": 1000 * laser_mm})


def save(book, name):
    """Leaves out theme and document properties: no reader of numbers needs these 3 kB."""
    with tempfile.TemporaryFile() as whole:
        book.save(whole)
        with zipfile.ZipFile(whole) as parts, zipfile.ZipFile(HERE / name, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as file:
            for part in parts.namelist():
                if not part.startswith(("xl/theme", "docProps")):
                    file.writestr(part, parts.read(part))


book = openpyxl.Workbook()
sheet = book.active
sheet.title = "Run 3"
sheet.append(["Film 3, first run"])
sheet.append(["Operator", "AB"])
sheet.append([])
sheet.append(["Time", "High voltage", "Laser", "Room"])
sheet.append(["s", "kV", "mm", "°C"])
for row in zip(time_s, voltage_kv, laser_mm, 21 + 0 * k):
    sheet.append([float(value) for value in row])
sheet["C10"] = None
book.create_sheet("Notes").append(["the laser was cleaned before"])
save(book, "workbook.xlsx")

other = book.copy_worksheet(sheet)
other.title = "Run 4"
save(book, "two-runs.xlsx")

book = openpyxl.Workbook()
sheet = book.active
sheet.append(["Time", "HV (kV)", "Laser (mm)"])
start = datetime.datetime(2026, 11, 24, 23, 59, 58, 500000)
for t, *row in zip(time_s, voltage_kv, laser_mm):
    sheet.append([start + datetime.timedelta(seconds=float(t)), *map(float, row)])
sheet.append(["Mean", float(voltage_kv.mean()), float(laser_mm.mean())])
save(book, "dates.xlsx")

book = openpyxl.Workbook()
book.active.append(["Time (s)", "HV (kV)", "Laser (mm)"])
for t, volts, laser in zip(time_s, voltage_kv, laser_mm):
    book.active.append([float(t), float(volts), f"{1 + laser:.3f}".replace(".", ",")])
save(book, "texts.xlsx")

# The voltage and the displacement in sheets of their own.
book = openpyxl.Workbook()
book.active.title = "HV"
laser_sheet = book.create_sheet("Laser")
book.active.append(["Time (s)", "HV (kV)"])
laser_sheet.append(["Time (s)", "Laser (mm)"])
for t, volts, laser in zip(time_s, voltage_kv, laser_mm):
    book.active.append([float(t), float(volts)])
    laser_sheet.append([float(t), float(laser)])
save(book, "split.xlsx")

with zipfile.ZipFile(HERE / "archive.zip", "w") as file:
    file.writestr("film.csv", "time_s,voltage_v\n0,0\n1,1\n")
