"""The page of `springpot bench` in a real browser: looks, keys, and how each way to lose it ends. Takes pictures for the book.

bench.py BROWSER TOOL BOARD PICTURES [CLICKS]: TOOL is springpot, BOARD a board that runs on this computer, prints its port, and then when its
enable output changes. CLICKS is the number of stops whose time is measured.
"""

import json
import os
import pathlib
import queue
import signal
import subprocess
import sys
import tempfile
import threading
import time

from browser import Browser

PATIENCE_S = 1.5
STATE = "document.getElementById('state').dataset.state"


class Program:
    """A program that ends with its block, whatever fails in it."""

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.wait()


class Board(Program):
    """A board, and the changes of its enable output as they come."""

    def __init__(self, program):
        self.process = subprocess.Popen([program, "changes"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.port = self.process.stdout.readline().strip()
        self.enabled = False
        self.changes = queue.Queue()
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self):
        for line in self.process.stdout:
            enabled, nanoseconds = line.split()
            self.enabled = enabled == "1"
            self.changes.put((self.enabled, int(nanoseconds) / 1e9))

    def falls(self, since, within_s):
        """Time from `since` until the output is low, s; it must be within so many seconds."""
        while True:
            enabled, at = self.changes.get(timeout=within_s + 5)
            if not enabled:
                assert -0.01 <= at - since <= within_s, f"{at - since} s for {within_s}"
                return at - since

    def rises(self, seconds=10):
        """Waits until it is high; returns False where that takes longer."""
        try:
            while not self.changes.get(timeout=seconds)[0]:
                pass
        except queue.Empty:
            return False
        return True


class Bench(Program):
    """The tool at a board, which `options` name."""

    def __init__(self, tool, options, folder):
        command = [tool, "bench", *options, "--params", "preset:table3-n2", "--out", folder, "-q"]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        self.address = self.process.stdout.readline().strip()

    def end(self):
        """Ends it as Ctrl-C does."""
        self.process.send_signal(signal.SIGINT)
        self.process.wait(timeout=20)


def arm(page, board):
    """Arms, and waits for the board."""
    page.wait("!document.getElementById('arm').disabled")
    page.click("arm")
    assert board.rises(), f"not armed: {page.text('message')}; {page.text('whose')}"
    page.wait("!document.getElementById('play').disabled")


def play(page):
    """Plays a sine of the stroke for ten minutes."""
    for name, value in {"mode": "tracking", "low": 0.25, "high": 0.6, "period": 6, "duration": 600}.items():
        page.run(f"(() => {{ const e = document.getElementById('{name}'); e.value = '{value}'; e.dispatchEvent(new Event('change')); }})()")
    page.click("play")
    page.wait(f"{STATE} === 'running'")


def messages(browser):
    """Returns messages on the console, and scripts that failed."""
    found = []
    while not browser.events.empty():
        event = browser.events.get()
        if event["method"] in ("Log.entryAdded", "Runtime.exceptionThrown", "Runtime.consoleAPICalled"):
            found.append(json.dumps(event["params"])[:300])
    # The answers of a tool that was ended, and requests that it refuses in words.
    return [text for text in found if "ERR_CONNECTION" not in text and "409" not in text and "ERR_INCOMPLETE" not in text]


def looks(browser, page, board, pictures):
    """In four windows: the stop button in sight wherever the page is scrolled to, nothing wider than the window, every control with a name."""
    arm(page, board)
    play(page)
    time.sleep(12)
    for name, width, height, dark in (
        ("bench", 1280, 960, False), ("bench-dark", 1280, 960, True), ("bench-phone-light", 390, 844, False), ("bench-phone", 390, 844, True),
    ):  # fmt: skip
        page.size(width, height, 1, dark)
        time.sleep(0.4)
        for end in ("0", "document.body.scrollHeight"):
            page.run(f"scrollTo({{top: {end}, behavior: 'instant'}})")
            found = page.run(
                "(() => { const r = document.getElementById('stop').getBoundingClientRect();"
                " const e = document.elementFromPoint(r.x + r.width / 2, r.y + r.height / 2);"
                " return [r.top >= 0 && r.bottom <= innerHeight, e.closest('#stop') !== null, document.documentElement.scrollWidth <= innerWidth,"
                " r.height >= 44 && r.width >= 88]; })()"
            )
            assert found == [True] * 4, f"{name}: {found}"
        page.run("scrollTo({top: 0, behavior: 'instant'})")
        time.sleep(0.2)
        page.picture(pictures / f"{name}.webp")
    nameless = page.run(
        "[...document.querySelectorAll('button, input, select')].filter((e) => !(e.textContent.trim() || e.labels?.length || e.ariaLabel)).length"
    )
    assert nameless == 0, f"{nameless} controls without a name"
    axe = os.environ.get("SPRINGPOT_AXE")
    if axe:
        page.run(pathlib.Path(axe).read_text(encoding="utf-8"))
        for dark in (False, True):
            page.size(1280, 960, 1, dark)
            time.sleep(0.3)
            found = page.run("axe.run().then((r) => r.violations.map((v) => [v.impact, v.id, v.nodes.length, v.nodes[0].html, v.nodes[0].failureSummary]))")
            for line in found:
                print("axe:", line)
            assert not [line for line in found if line[0] in ("serious", "critical")], "axe-core"
        print("axe-core: no serious findings, light and dark")
    page.size(1280, 960)
    print(f"looks: 4 windows; {page.text('recording')}")


def stops(page, board):
    """The button by mouse, Enter on it, and the space bar, wherever the focus is."""
    for number, way in enumerate(("button", "enter", "space", "space in a field", "space on another button")):
        if number > 0:
            arm(page, board)
            play(page)
        since = time.time()
        if way == "button":
            page.click("stop")
        else:
            page.run("document.getElementById({'enter': 'stop', 'space': 'stop', 'space in a field': 'low', 'space on another button': 'tune'}['%s']).focus()" % way)
            since = time.time()
            page.key(*(("Enter", "Enter", "\r") if way == "enter" else (" ", "Space", " ")))
        board.falls(since, 1.0)
        page.wait(f"{STATE} === 'disarmed'")
        print(f"{way}: {page.text('message')}")


def losses(browser, page, bench, board):
    """Each way to lose the page or the computer."""
    arm(page, board)
    play(page)
    since = time.time()
    browser.page("about:blank").front()
    print(f"another tab in front: {board.falls(since, 2.0):.3f} s")
    time.sleep(2.5)
    page.front()
    page.wait(f"{STATE} === 'disarmed' && !document.getElementById('arm').disabled")

    arm(page, board)
    window = browser.call("Browser.getWindowForTarget", targetId=page.target)["windowId"]
    since = time.time()
    browser.call("Browser.setWindowBounds", windowId=window, bounds={"windowState": "minimized"})
    print(f"window minimised: {board.falls(since, 1.0):.3f} s")
    browser.call("Browser.setWindowBounds", windowId=window, bounds={"windowState": "normal"})
    page.front()

    arm(page, board)
    since = time.time()
    page.run("setTimeout(() => { for (const from = performance.now(); performance.now() - from < 5000; ); }, 0)")
    print(f"page hangs: {board.falls(since, PATIENCE_S + 1.0):.3f} s")
    page.wait(f"{STATE} === 'disarmed'")

    arm(page, board)
    since = time.time()
    page.run("window.before = true")
    page.call("Page.reload")
    print(f"page loaded again: {board.falls(since, 1.0):.3f} s")
    page.wait("window.before === undefined && document.readyState === 'complete'")

    arm(page, board)
    since = time.time()
    second = browser.page(bench.address)
    # It came in front, so the first one was hidden: disarmed. The second gets no control of what is armed, and takes it afterwards.
    board.falls(since, 2.0)
    second.wait("!document.getElementById('arm').disabled || !document.getElementById('control').disabled")
    if second.run("document.getElementById('arm').disabled"):
        second.click("control")
    arm(second, board)
    assert page.run("document.getElementById('arm').disabled") is True
    since = time.time()
    second.close()
    print(f"page closed: {board.falls(since, 1.0):.3f} s")
    page.front()
    page.wait("!document.getElementById('control').disabled")
    page.click("control")

    arm(page, board)
    since = time.time()
    os.kill(bench.process.pid, signal.SIGSTOP)
    print(f"tool asleep: {board.falls(since, 1.0):.3f} s, by the board")
    time.sleep(2.0)
    os.kill(bench.process.pid, signal.SIGCONT)
    page.wait(f"{STATE} === 'tripped'")
    page.wait("!document.getElementById('acknowledge').disabled")
    page.click("acknowledge")
    page.wait(f"{STATE} === 'disarmed'")


def clicks(page, board, count):
    """From a click in the browser to the enable output."""
    times = []
    for _ in range(count):
        arm(page, board)
        since = time.time()
        page.click("stop")
        times.append(1e3 * board.falls(since, 5.0))
        page.wait(f"{STATE} === 'disarmed'")
    times.sort()
    at = lambda share: times[int((len(times) - 1) * share)]  # noqa: E731
    print(f"{count} clicks, DevTools included: median {at(0.5):.1f} ms, 99 % {at(0.99):.1f}, 99.9 % {at(0.999):.1f}, largest {at(1):.1f}")


def main(program, tool, board, pictures, count="0"):
    pictures = pathlib.Path(pictures)
    pictures.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder, Board(board) as board, Bench(tool, ["--port", board.port, "--bench"], folder) as bench:
        with Browser(program) as browser:
            page = browser.page(bench.address)
            page.size(1280, 960)
            page.wait(f"{STATE} === 'disarmed'")
            assert "#" not in page.run("location.href"), "the secret is in the address bar"
            looks(browser, page, board, pictures)
            stops(page, board)
            losses(browser, page, bench, board)
            if int(count):
                clicks(page, board, int(count))
            arm(page, board)
            found = messages(browser)
            assert not found, found
            since = time.time()
            browser.kill()
            print(f"browser killed: {board.falls(since, PATIENCE_S + 1.0):.3f} s")
        bench.end()
    print("the page is as documented")


if __name__ == "__main__":
    main(*sys.argv[1:])
