"""Long runs on the page of `springpot bench`, in a real browser.

hours.py BROWSER TOOL sitting: a whole sitting on the simulated bench, in the time that it takes: armed, ramp to verdict, and the record opened.
hours.py BROWSER TOOL HOURS: the states of so many hours of a run, for the first ten minutes one for each picture that the page draws, then ten;
memory of the browser after ten minutes and after each hour.
"""

import json
import pathlib
import subprocess
import sys
import tempfile
import time

from bench import STATE, Bench
from browser import Browser

# The paper's film on the simulated bench, within what it was stretched for.
BOARD = """schema = 1
name = "a film"

[actuator]
length_m = 0.04
width_m = 0.06
thickness_m = 160e-6
relative_permittivity = 4.7
mass_kg = 0.316

[board]
id = 1029
command_range = "ten-volts"
amplifier = { offset = 0.0, gain = 1000.0, quadratic = 0.0 }
monitor = { offset = 0.0, gain = 1000.0, quadratic = 0.0 }
sensor = { offset = -1e-3, gain = 1e-3, quadratic = 0.0 }

[board.limits]
max_voltage_v = 6000.0
max_field_v_per_m = 4.2e7
thickness_m = 160e-6
max_slew_v_per_s = 50e3
max_displacement_m = 8e-3
monitor = { slew_v_per_s = 100e3, band_v = 60.0, band_share = 0.03, settle_s = 0.02 }
sensor = { low = -0.5e-3, high = 9e-3, jump = 0.5e-3, stuck_ticks = 500 }
on_sensor_fault = "trip"
heartbeat_s = 0.5
"""

# Pictures as fast as they are drawn, and none of the browser's own work behind the page, which it begins after some minutes.
QUICK = ("--disable-frame-rate-limit", "--disable-gpu-vsync", "--disable-background-networking", "--disable-component-update")

# The first state that the tool sends, then those of a sine of 10 s, 20 a second of its time, as fast as they are drawn.
STATES = """(() => {
  const original = window.fetch;
  let newest = 0;
  window.sent = 0;
  window.paused = false;
  const read = async (reader) => {
    for (let rest = ""; ; ) {
      const { value, done } = await reader.read();
      if (done) return;
      const events = (rest + value).split("\\n\\n");
      rest = events.pop();
      events.forEach((event) => (newest = JSON.parse(event.slice("data: ".length)).at_ms));
    }
  };
  window.fetch = async (address, options) => {
    // The tool gets the newest state of its own.
    if (options.body?.includes("drew")) options.body = options.body.replace(/"at_ms":\\d+/, `"at_ms":${newest}`);
    const answer = await original(address, options);
    if (address !== "/api/live" || !answer.ok) return answer;
    const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader();
    const first = JSON.parse((await reader.read()).value.split("\\n\\n")[0].slice("data: ".length));
    read(reader);
    const encoder = new TextEncoder();
    const frame = () => new Promise((done) => requestAnimationFrame(done));
    const pull = async (controller) => {
      if (window.sent < 12000 || window.sent % 10 === 0) await frame();
      while (window.paused) await frame();
      const seconds = window.sent / 20;
      const phase = (2 * Math.PI * seconds) / 10;
      const noise = () => 5e-6 * (Math.random() - 0.5);
      const reference = 1e-3 * (1.5 - Math.cos(phase));
      const voltage = 2000 - 1500 * Math.cos(phase) + 3 * Math.sin(0.7 * phase);
      const state = {
        ...first, at_ms: first.at_ms + 50 * window.sent, state: "running", live: true, command_v: voltage, monitor_v: voltage + 1e6 * noise(),
        displacement_m: reference + noise(), reference_m: reference, limited: window.sent % 400 < 20 ? ["slew"] : [], recording: "run-001.csv",
        samples: [50 * window.sent, 0], playing: "sine", played_s: [seconds, 1e6], message: `minute ${Math.floor(seconds / 60)}`,
      };
      controller.enqueue(encoder.encode(`data: ${JSON.stringify(state)}\\n\\n`));
      window.sent += 1;
    };
    return new Response(new ReadableStream({ pull }), { headers: { "Content-Type": "text/event-stream" } });
  };
})()"""


def memory(browser, page):
    """Memory of the page's scripts, and of all processes of the browser without the files that it shares with others, MB, when it is idle."""
    page.run("window.paused = true")
    for _ in range(2):
        page.call("HeapProfiler.collectGarbage")
        time.sleep(2)
    heap = page.call("Runtime.getHeapUsage")["usedSize"]
    own = 0
    for process in browser.call("SystemInfo.getProcessInfo")["processInfo"]:
        rollup = pathlib.Path(f"/proc/{process['id']}/smaps_rollup")
        lines = rollup.read_text().splitlines() if rollup.exists() else []
        own += sum(1024 * int(line.split()[1]) for line in lines if line.startswith(("Pss_Anon:", "Pss_Shmem:")))
    page.run("window.paused = false")
    return heap / 1e6, own / 1e6


def hours(program, tool, count):
    """Hours of states; the browser's memory stays within 20 MB of what it was after ten minutes."""
    with tempfile.TemporaryDirectory() as folder, Bench(tool, ["--plant", "hossain"], folder) as bench:
        with Browser(program, *QUICK) as browser:
            page = browser.page("about:blank")
            page.call("Page.addScriptToEvaluateOnNewDocument", source=STATES)
            page.size(1280, 960)
            page.call("Page.navigate", url=bench.address)
            start = None
            for minutes in [10, *range(60, int(60 * count) + 1, 60)]:
                page.wait(f"window.sent >= {20 * 60 * minutes}", 3600)
                now = memory(browser, page)
                start = start or now
                shown = page.text("message")
                print(f"{minutes} min: scripts {now[0]:.1f} MB, browser {now[1]:.0f} MB; {shown}", flush=True)
                assert shown.startswith("minute") and page.run(STATE) == "running", shown
                assert all(later < first + 20 for later, first in zip(now, start)), f"{start} MB, then {now}"


def record_opened(browser, page, name):
    """Text of the record `name` that the page opens in another tab."""
    page.wait(f"[...document.getElementById('file').options].some((o) => o.value === '{name}')")
    page.run(f"document.getElementById('file').value = '{name}'")
    page.click("report")
    opened = next(event for event in iter(lambda: browser.events.get(timeout=20), None) if event["method"] == "Page.windowOpen")
    report = browser.page(opened["params"]["url"])
    report.wait("document.readyState === 'complete' && document.body.innerText.length > 500")
    return report.run("document.body.innerText")


def sitting(program, tool):
    """Commissions a film from the page, and opens its record."""
    with tempfile.TemporaryDirectory() as folder:
        board = pathlib.Path(folder) / "b.toml"
        board.write_text(BOARD, encoding="utf-8")
        out = pathlib.Path(folder) / "sittings"
        with Bench(tool, ["--plant", "hossain", "--board", board], out) as bench, Browser(program) as browser:
            page = browser.page(bench.address)
            page.size(1280, 960)
            page.wait("!document.getElementById('commission').disabled")
            page.run("document.getElementById('gauge').value = '2mm:2.0mm'")
            page.run("document.getElementById('serial').value = 'A17'")
            page.click("commission")
            page.wait(f"{STATE} === 'commissioning'")
            step = None
            while page.run(STATE) == "commissioning":
                step, before = page.text("playing").rpartition(": ")[0], step
                if step != before:
                    print(page.text("playing"), flush=True)
                time.sleep(1)
            print(f"{page.run(STATE)}: {page.text('message')}", flush=True)
            shown = record_opened(browser, page, "sitting-1/record.html")
            print(shown[: shown.index("Where this comes from")], flush=True)
            record = out / "sitting-1" / "record.json"
            subprocess.run([tool, "verify", record], check=True)
            assert json.loads(record.read_text(encoding="utf-8"))["verdict"]["passed"]


if __name__ == "__main__":
    if sys.argv[3] == "sitting":
        sitting(*sys.argv[1:3])
    else:
        hours(*sys.argv[1:3], float(sys.argv[3]))
