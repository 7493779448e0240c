"""A browser without a window, talked to over a pipe by its DevTools protocol: the standard library is enough."""

import base64
import json
import os
import queue
import subprocess
import tempfile
import threading
import time


class Browser:
    """A running browser; `with` ends it."""

    def __init__(self, program, *options):
        self.profile = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        to_read, self._to = os.pipe()
        self._from, to_write = os.pipe()

        def place():
            # The browser reads at 3 and writes at 4; neither number may be taken on the way.
            reads, writes = os.dup(to_read), os.dup(to_write)
            high = [os.dup2(fd, at) for fd, at in ((reads, 20), (writes, 21))]
            os.dup2(high[0], 3)
            os.dup2(high[1], 4)

        command = [
            program, "--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--no-first-run",
            "--remote-debugging-pipe", f"--user-data-dir={self.profile.name}", *options, "about:blank",
        ]  # fmt: skip
        self.process = subprocess.Popen(
            command, preexec_fn=place, close_fds=False, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL
        )
        os.close(to_read)
        os.close(to_write)
        self._number = 0
        self._answers = {}
        self.events = queue.Queue()
        self._lock = threading.Lock()
        threading.Thread(target=self._receive, daemon=True).start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.kill()
        self.profile.cleanup()

    def kill(self):
        """Ends it as a crash would."""
        self.process.kill()
        self.process.wait()

    def _receive(self):
        rest = b""
        while True:
            try:
                piece = os.read(self._from, 1 << 16)
            except OSError:
                return
            if not piece:
                return
            *whole, rest = (rest + piece).split(b"\0")
            for message in map(json.loads, whole):
                if "id" in message:
                    self._answers.pop(message["id"]).put(message)
                else:
                    self.events.put(message)

    def call(self, method, session=None, **parameters):
        """Sends a command and returns its result."""
        with self._lock:
            self._number += 1
            answer = self._answers[self._number] = queue.Queue()
            message = {"id": self._number, "method": method, "params": parameters}
            if session:
                message["sessionId"] = session
            os.write(self._to, json.dumps(message).encode() + b"\0")
        result = answer.get(timeout=60)
        if "error" in result:
            raise RuntimeError(f"{method}: {result['error']}")
        return result["result"]

    def page(self, address):
        """Opens a tab."""
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        page = Page(self, target, self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"])
        for domain in ("Page", "Runtime", "Log"):
            page.call(f"{domain}.enable")
        page.call("Page.navigate", url=address)
        return page


class Page:
    """A tab."""

    def __init__(self, browser, target, session):
        self.browser, self.target, self.session = browser, target, session

    def call(self, method, **parameters):
        """Sends a command to it."""
        return self.browser.call(method, session=self.session, **parameters)

    def run(self, script):
        """Returns the value of a script, which may be a promise."""
        done = self.call("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in done:
            raise RuntimeError(done["exceptionDetails"])
        return done["result"].get("value")

    def text(self, element):
        """Text of the element with this id."""
        return self.run(f"document.getElementById('{element}').textContent.trim()")

    def wait(self, script, seconds=20):
        """Waits until a script is true."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            try:
                if self.run(script):
                    return
            except RuntimeError:
                # It is still loading.
                pass
            time.sleep(0.02)
        raise AssertionError(f"not within {seconds} s: {script}; {self.text('state')}; {self.text('message')}")

    def click(self, element):
        """Clicks as a mouse does."""
        place = self.run(
            f"(() => {{ const e = document.getElementById('{element}'); e.scrollIntoView({{block: 'center', behavior: 'instant'}});"
            " const r = e.getBoundingClientRect(); return [r.x + r.width / 2, r.y + r.height / 2]; })()"
        )
        for kind in ("mousePressed", "mouseReleased"):
            self.call("Input.dispatchMouseEvent", type=kind, x=place[0], y=place[1], button="left", clickCount=1)

    def key(self, key, code, text=""):
        """Presses a key."""
        for kind in ("keyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=key, code=code, text=text if kind == "keyDown" else "")

    def size(self, width, height, scale=1, dark=False):
        """Sets the window and the colours."""
        self.call(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=scale, mobile=width < 500
        )
        features = [{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}]
        self.call("Emulation.setEmulatedMedia", features=features)

    def picture(self, path):
        """Writes a picture of the window, small enough for a repository."""
        data = self.call("Page.captureScreenshot", format="webp", quality=50)["data"]
        with open(path, "wb") as file:
            file.write(base64.b64decode(data))

    def close(self):
        """Closes the tab."""
        self.browser.call("Target.closeTarget", targetId=self.target)

    def front(self):
        """Brings it to the front; others of the window are hidden."""
        self.call("Page.bringToFront")
