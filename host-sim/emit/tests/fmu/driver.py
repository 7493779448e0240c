"""Drives an FMU of springpot export with FMPy, for tests/command_line/export_fmu.rs.

driver.py run FILE.fmu MODE INPUTS OUTPUTS [PARAMETER…]    a run tick by tick, these parameters true: rows of f64 in, rows of f64 out
driver.py check FILE.fmu learns|does-not-learn OTHER.fmu   schema, signatures, steps, states, refusals; libraries built anew, one with sanitizers
driver.py cost FILE.fmu                                    prints what steps take
"""

import math
import os
import shutil
import subprocess
import sys
import tempfile
import time
from contextlib import contextmanager

import fmpy
import numpy as np
from fmpy.build import build_platform_binary
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu

STEP_S = 1e-3
MODES = {"plant": 1, "observer": 2, "feedforward": 3, "tracking": 4, "adaptive": 5}
REALS_IN = ["voltage", "reference", "sample", "reading", "temperature"]
FLAGS_IN = ["sample_taken", "reading_taken"]
REALS_OUT = ["displacement", "force", "command", "shaped_reference", "disturbance", "force_scale", "ageing", "stiffness_change"]
ERROR = 3
HEADERS = os.path.join(os.path.dirname(fmpy.__file__), "c-code")


class Instance:
    """An instance by the names of its variables, for both versions."""

    def __init__(self, folder, description, start=0.0, **parameters):
        self.references = {v.name: v.valueReference for v in description.modelVariables}
        self.is_3 = description.fmiVersion.startswith("3")
        self.messages = []
        kwargs = dict(
            guid=description.guid,
            unzipDirectory=folder,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="film",
        )
        if self.is_3:
            self.fmu = FMU3Slave(**kwargs)
            self.fmu.instantiate(logMessage=lambda _e, status, _c, text: self.messages.append((status, text.decode())))
        else:
            self.fmu = FMU2Slave(**kwargs)
            self.fmu.instantiate()
        self.set(**parameters)
        if self.is_3:
            self.fmu.enterInitializationMode(startTime=start)
        else:
            self.fmu.setupExperiment(startTime=start)
            self.fmu.enterInitializationMode()
        self.time = start

    def begun(self):
        self.fmu.exitInitializationMode()
        return self

    def of(self, names):
        return [self.references[name] for name in names]

    def set_reals(self, names, values):
        (self.fmu.setFloat64 if self.is_3 else self.fmu.setReal)(self.of(names), values)

    def set_flags(self, names, values):
        self.fmu.setBoolean(self.of(names), values)

    def set_whole(self, name, value):
        if self.is_3:
            (self.fmu.setInt64 if name == "mode" else self.fmu.setInt32)(self.of([name]), [value])
        else:
            self.fmu.setInteger(self.of([name]), [value])

    def set(self, **values):
        for name, value in values.items():
            if isinstance(value, bool):
                self.set_flags([name], [value])
            elif isinstance(value, int):
                self.set_whole(name, value)
            else:
                self.set_reals([name], [value])

    def step(self, step_s=STEP_S):
        self.fmu.doStep(self.time, step_s)
        self.time += step_s

    def outputs(self):
        reals = (self.fmu.getFloat64 if self.is_3 else self.fmu.getReal)(self.of(REALS_OUT))
        limits = (self.fmu.getInt32 if self.is_3 else self.fmu.getInteger)(self.of(["limits"]))
        lost = self.fmu.getBoolean(self.of(["sensor_lost"]))
        return [*reals, float(limits[0]), float(bool(lost[0]))]

    def state(self):
        return self.fmu.getFMUState() if self.is_3 else self.fmu.getFMUstate()

    def restore(self, state, time=0.0):
        (self.fmu.setFMUState if self.is_3 else self.fmu.setFMUstate)(state)
        self.time = time

    def free(self, state):
        (self.fmu.freeFMUState if self.is_3 else self.fmu.freeFMUstate)(state)

    def bytes_of(self, state):
        return (self.fmu.serializeFMUState if self.is_3 else self.fmu.serializeFMUstate)(state)

    def state_of(self, content):
        return (self.fmu.deserializeFMUState if self.is_3 else self.fmu.deSerializeFMUstate)(content)

    def end(self):
        self.fmu.terminate()
        self.fmu.freeInstance()


@contextmanager
def refused(what):
    """The calls within are refused as errors, not to be tried again."""
    try:
        yield
    except FMICallException as refusal:
        assert refusal.status == ERROR, f"{what}: status {refusal.status}"
    else:
        raise AssertionError(f"{what} is accepted")


def run(path, mode, inputs, outputs, *parameters):
    description, folder = fmpy.read_model_description(path), fmpy.extract(path)
    film = Instance(folder, description, mode=MODES[mode], **{name: True for name in parameters}).begun()
    rows = np.fromfile(inputs).reshape(-1, 8)
    written = np.empty((len(rows), 10))
    for k, (voltage, reference, sample, taken, age, reading, has_reading, celsius) in enumerate(rows.tolist()):
        film.set_reals(REALS_IN, [voltage, reference, sample, reading, celsius])
        film.set_flags(FLAGS_IN, [taken != 0.0, has_reading != 0.0])
        film.set_whole("sample_age", int(age))
        # As an importer that takes differences of times.
        film.fmu.doStep(k * STEP_S, (k + 1) * STEP_S - k * STEP_S)
        written[k] = film.outputs()
    written.tofile(outputs)
    film.end()
    shutil.rmtree(folder)


def check_steps(folder, description):
    one, five = (Instance(folder, description, mode=1, voltage=3000.0).begun() for _ in range(2))
    for _ in range(10):
        for _ in range(5):
            one.step()
        five.step(5 * STEP_S)
        assert one.outputs() == five.outputs()
    assert one.outputs()[0] > 1e-5, "the film moves"
    for step_s in [0.5 * STEP_S, 1.5 * STEP_S, 0.0, -STEP_S, 1.001 * STEP_S, float("nan"), float("inf")]:
        before = five.outputs()
        with refused(f"a step of {step_s} s"):
            five.fmu.doStep(five.time, step_s)
        assert five.outputs() == before
    for gap_s in [-STEP_S, STEP_S, 1.0, float("nan")]:
        with refused(f"a step that begins {gap_s} s after the last one ended"):
            five.fmu.doStep(five.time + gap_s, STEP_S)
        assert five.outputs() == before
    one.step()
    five.step()
    assert one.outputs() == five.outputs(), "a step that was refused changed something"
    # A sample counts in the first tick of a step.
    each, both = (Instance(folder, description, mode=2, voltage=3000.0, sample=1e-4, sample_taken=True).begun() for _ in range(2))
    each.step()
    first = each.outputs()
    each.set(sample_taken=False)
    each.step()
    both.step(2 * STEP_S)
    assert both.outputs() == each.outputs() != first
    assert first[4] != 0.0, "the sample counts"
    each.end()
    both.end()
    for mode in [3, 4, 5]:
        controller = Instance(folder, description, mode=mode, reference=1e-3).begun()
        for ticks in [2, 10]:
            with refused(f"a controller's step of {ticks} ticks"):
                controller.step(ticks * STEP_S)
        controller.step()
        controller.end()
    one.end()
    five.end()


def check_states(folder, description, learns):
    # What is learned has a state of its own, beside that of the laws.
    cases = [(name, mode, False) for name, mode in MODES.items()]
    cases += [("feedforward, learning", MODES["feedforward"], True)] if learns else []
    for name, mode, learning in cases:
        start = dict(mode=mode, learning=learning, voltage=4000.0, sample_age=1, reading_taken=True)
        film = Instance(folder, description, **start).begun()

        def ticks(film, count):
            """Cycles of 1 s; a film with 4 % more stroke, an amplifier with 2 % more gain."""
            rows = [film.outputs()]
            for k in range(count):
                turn = abs(k % 1000 - 500) / 500.0
                reference = 0.8e-3 - 0.2e-3 * turn * turn * (3.0 - 2.0 * turn)
                displacement, _, command, *_ = rows[-1]
                film.set_reals(["reference", "sample", "reading"], [reference, 1.04 * displacement, 1.02 * command])
                film.set_flags(["sample_taken"], [k % 10 == 0])
                film.step()
                rows.append(film.outputs())
            return rows

        ticks(film, 4000)
        state, now = film.state(), film.time
        content = film.bytes_of(state)
        expected = ticks(film, 2000)
        assert expected[0] != expected[-1], name
        film.restore(state, now)
        assert ticks(film, 2000) == expected, f"{name}: from a state"
        other = Instance(folder, description, mode=1).begun()
        other.restore(other.state_of(content), now)
        assert ticks(other, 2000) == expected, f"{name}: from bytes in another instance"
        for changed in [content[:-1], bytes([content[0] ^ 1]) + content[1:], content[:-9] + bytes([content[-9] ^ 4]) + content[-8:]]:
            with refused("a state that was changed"):
                film.state_of(changed)
        film.free(state)
        film.fmu.reset()
        film.time = 0.0
        if not film.is_3:
            film.fmu.setupExperiment(startTime=0.0)
        film.fmu.enterInitializationMode()
        film.set(**start)
        film.begun()
        ticks(film, 4000)
        assert ticks(film, 2000) == expected, f"{name}: after a reset"
        film.end()
        other.end()
        if learning:
            without = Instance(folder, description, **{**start, "learning": False}).begun()
            ticks(without, 4000)
            assert ticks(without, 2000) != expected, "nothing was learned"
            without.end()


def check_refusals(folder, description, learns, other_path):
    learner = Instance(folder, description, mode=4, learning=True)
    if learns:
        learner.begun()
    else:
        with refused("learning by a film that does not learn"):
            learner.begun()
    # The film that learns was fitted at several temperatures as well.
    for mode in MODES.values():
        warm = Instance(folder, description, mode=mode, temperature_is_given=True, temperature=30.0)
        if learns and mode >= MODES["tracking"]:
            warm.begun().step()
            for celsius in [90.0, -60.0, -274.0]:
                warm.set_reals(["temperature"], [celsius])
                with refused(f"{celsius} degrees C"):
                    warm.step()
            warm.set_reals(["temperature"], [35.0])
            warm.step()
        else:
            with refused("a temperature by a film or a mode without one"):
                warm.begun()
    with refused("a start at NaN"):
        Instance(folder, description, start=float("nan"))
    film = Instance(folder, description, start=5.0, mode=1)
    with refused("a step before initialisation has ended"):
        film.step()
    for value in [float("nan"), float("inf"), 1e39]:
        with refused(f"{value} V"):
            film.set_reals(["voltage"], [value])
    for name, value in [("mode", 0), ("mode", 6), ("sample_age", 64), ("sample_age", -1), ("displacement", 1.0), ("limits", 1)]:
        with refused(f"{name} = {value}"):
            film.set(**{name: value})
    with refused("a real of a flag"):
        film.set_reals(["learning"], [1.0])
    film.begun()
    with refused("a mode after initialisation"):
        film.set_whole("mode", 2)
    film.step()
    # A film of another file, whose states have the same size.
    stranger_folder = fmpy.extract(other_path)
    stranger = Instance(stranger_folder, fmpy.read_model_description(other_path), mode=1).begun()
    state = stranger.state()
    for what, call in [("a state", film.restore), ("to serialise a state", film.bytes_of)]:
        with refused(f"{what} of another film"):
            call(state)
    with refused("bytes of another film"):
        film.state_of(stranger.bytes_of(state))
    stranger.free(state)
    stranger.end()
    shutil.rmtree(stranger_folder)
    film.end()
    if film.is_3:
        for words in ["single precision", "another FMU"]:
            assert any(words in text for _, text in film.messages), film.messages
    other = fmpy.read_model_description(folder)
    other.guid = "{00000000-0000-0000-0000-000000000000}"
    try:
        Instance(folder, other)
    except Exception as refusal:
        assert "nstantiat" in str(refusal), refusal
    else:
        raise AssertionError("another token is accepted")


def constant(path):
    """Displacement under 3 kV, by FMPy's own loop."""
    result = fmpy.simulate_fmu(path, stop_time=0.5, step_size=STEP_S, output_interval=STEP_S, start_values={"voltage": 3000.0})
    return np.array(result["displacement"])


def cost(path):
    description, folder = fmpy.read_model_description(path), fmpy.extract(path)
    ticks = 155_000
    for name, mode in MODES.items():
        film = Instance(folder, description, mode=mode, voltage=3000.0, reference=1e-3).begun()
        begin = time.perf_counter()
        for _ in range(ticks):
            film.step()
        print(f"{name}: {1e6 * (time.perf_counter() - begin) / ticks:.2f} µs a step of one tick")
        film.end()
    film = Instance(folder, description, mode=1, voltage=3000.0).begun()
    begin = time.perf_counter()
    film.step(ticks * STEP_S)
    print(f"plant: {1e6 * (time.perf_counter() - begin) / ticks:.3f} µs a tick, {ticks} ticks in one step")
    film.end()
    shutil.rmtree(folder)


def calls(path, learns, other):
    """All but what reads the file: FILE may be a folder."""
    description, folder = fmpy.read_model_description(path), path if os.path.isdir(path) else fmpy.extract(path)
    learns = {"learns": True, "does-not-learn": False}[learns]
    check_steps(folder, description)
    check_states(folder, description, learns)
    check_refusals(folder, description, learns, other)


def check_sanitized(folder, description, *arguments):
    """The same calls with the sanitizers of gcc in the library; Python itself has leaks."""
    sources, is_3 = os.path.join(folder, "sources"), description.fmiVersion.startswith("3")
    interface = "fmi3.c" if is_3 else "fmi2.c"
    symbol = description.coSimulation.modelIdentifier
    gcc = ["gcc", "-std=c99", "-Wall", "-Wextra", "-Werror"]
    # Signatures against the standard's headers, which FMPy has.
    subprocess.run([*gcc, "-fsyntax-only", "-DFMI_STANDARD_HEADERS", f"-I{HEADERS}", interface], cwd=sources, check=True)
    library = os.path.join(folder, "binaries", "x86_64-linux" if is_3 else "linux64", f"{symbol}.so")
    checks = ["-O1", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-fPIC", "-shared"]
    subprocess.run([*gcc, *checks, interface, f"{symbol}.c", "-lm", "-o", library], cwd=sources, check=True)
    runtime = subprocess.run(["gcc", "-print-file-name=libasan.so"], check=True, capture_output=True, text=True).stdout.strip()
    environment = {**os.environ, "LD_PRELOAD": runtime, "ASAN_OPTIONS": "detect_leaks=0"}
    subprocess.run([sys.executable, __file__, "calls", folder, *arguments], env=environment, check=True)


def check(path, learns, other):
    problems = validate_fmu(path)
    assert not problems, problems
    description, folder = fmpy.read_model_description(path), fmpy.extract(path)
    calls(path, learns, other)
    moved = constant(path)
    assert len(moved) == 501 and moved[0] == 0.0 and moved[-1] > moved[1] > 0.0
    check_sanitized(folder, description, learns, other)
    # Built anew from the sources in the FMU, by its own description, with the CMake of this environment.
    os.environ["PATH"] = os.path.dirname(sys.executable) + os.pathsep + os.environ["PATH"]
    shutil.rmtree(os.path.join(folder, "binaries"))
    with tempfile.TemporaryDirectory() as built:
        build_platform_binary(folder, build_dir=built, all_warnings=True)
    assert np.array_equal(constant(folder), moved), "built anew it gives other numbers"
    shutil.rmtree(folder)


if __name__ == "__main__":
    {"run": run, "check": check, "calls": calls, "cost": cost}[sys.argv[1]](*sys.argv[2:])
