# SPDX-License-Identifier: GPL-2.0-or-later
"""Chromium of Debian by its debugging pipe (file descriptors 3 and 4, JSON ended by NUL).

A page is waited for by what it says of itself, never for a time; LIMIT_S ends a wait that would
not end, with the name of what it waited for.
"""

import base64
import fcntl
import json
import os
import select
import shutil
import subprocess
import tempfile
import time

LIMIT_S = 120


class Page:
    """One tab. Coordinates are CSS pixels of the window."""

    def __init__(self, browser, session):
        self.browser, self.session = browser, session
        self.says = []  # errors and console lines
        for domain in ("Page", "Runtime"):
            self.call(domain + ".enable")

    def call(self, method, **parameters):
        return self.browser.call(method, self.session, **parameters)

    def before(self, script):
        """Runs the script in each document before its own ones."""
        self.call("Page.addScriptToEvaluateOnNewDocument", source=script)

    def open(self, url):
        self.call("Page.navigate", url=url)

    def evaluate(self, expression):
        answer = self.call(
            "Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True
        )
        if "exceptionDetails" in answer:
            raise AssertionError(f"{expression}: {answer['exceptionDetails']}")
        return answer["result"].get("value")

    def wait_for(self, expression):
        """Looks once a frame of the page until the expression is true there; returns its value."""
        end = time.monotonic() + LIMIT_S
        while time.monotonic() < end:
            value = self.evaluate(
                "new Promise(done => { const look = n => { let v; try { v = (%s); } catch { } "
                "v || !n ? done(v) : setTimeout(look, 15, n - 1); }; look(20); })" % expression
            )
            if value:
                return value
        shown = self.evaluate("document.body.innerText.slice(0, 300)")
        raise AssertionError(f"not within {LIMIT_S} s: {expression}; {self.says}; shown: {shown}")

    def resize(self, width, height=900, ratio=1):
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=ratio,
            mobile=False,
        )

    def media(self, **features):
        """media(prefers_color_scheme="dark")"""
        named = [{"name": k.replace("_", "-"), "value": v} for k, v in features.items()]
        self.call("Emulation.setEmulatedMedia", features=named)

    def key(self, key, shift=False):
        text = {"text": key} if len(key) == 1 else {}
        for kind in ("keyDown", "keyUp"):
            self.call(
                "Input.dispatchKeyEvent", type=kind, key=key, modifiers=8 * shift,
                **(text if kind == "keyDown" else {})
            )  # fmt: skip

    def mouse(self, kind, x, y, **more):
        """kind: mousePressed, mouseMoved, mouseReleased, mouseWheel"""
        button = {} if kind == "mouseWheel" else {"button": "left", "clickCount": 1, "buttons": 1}
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **{**button, **more})

    def drag(self, x0, y0, x1, y1, **more):
        self.mouse("mousePressed", x0, y0, **more)
        for i in range(1, 6):
            self.mouse("mouseMoved", x0 + (x1 - x0) * i / 5, y0 + (y1 - y0) * i / 5, **more)
        self.mouse("mouseReleased", x1, y1, **more)

    def screenshot(self, path):
        answer = self.call("Page.captureScreenshot", format="png")
        with open(path, "wb") as file:
            file.write(base64.b64decode(answer["data"]))

    def heap(self):
        """Bytes of the page's JavaScript that are in use after a full collection."""
        self.call("HeapProfiler.collectGarbage")
        return self.call("Runtime.getHeapUsage")["usedSize"]

    def close(self):
        self.call("Page.close")


class Chromium:
    """The browser, with a profile of its own that goes with it."""

    def __init__(self):
        path = shutil.which("chromium")
        if not path:
            raise FileNotFoundError("chromium is not installed")
        self.profile = tempfile.TemporaryDirectory(
            prefix="incise-chromium-", ignore_cleanup_errors=True
        )
        there, self.write = os.pipe()
        self.read, back = os.pipe()
        high = [fcntl.fcntl(fd, fcntl.F_DUPFD, 10) for fd in (there, back)]

        def place():
            os.dup2(high[0], 3)
            os.dup2(high[1], 4)

        self.process = subprocess.Popen(
            [path, "--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars",
             "--no-first-run", "--disable-dev-shm-usage", "--disable-background-timer-throttling",
             "--disable-renderer-backgrounding", "--disable-backgrounding-occluded-windows",
             f"--user-data-dir={self.profile.name}",
             "--remote-debugging-pipe", "about:blank"],
            preexec_fn=place, pass_fds=(3, 4), stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
            stderr=open(os.path.join(self.profile.name, "stderr"), "wb"), start_new_session=True,
        )  # fmt: skip
        for fd in (there, back, *high):
            os.close(fd)
        self.buffer, self.number, self.pages = b"", 0, {}

    def __enter__(self):
        return self

    def __exit__(self, *_):
        try:
            self.call("Browser.close")
            self.process.wait(20)
        except (AssertionError, OSError, subprocess.TimeoutExpired):
            os.killpg(self.process.pid, 9)
            self.process.wait()
        os.close(self.read)
        os.close(self.write)
        self.profile.cleanup()

    def receive(self, until):
        while b"\0" not in self.buffer:
            left = until - time.monotonic()
            if left <= 0 or not select.select([self.read], [], [], left)[0]:
                return None
            piece = os.read(self.read, 1 << 20)
            if not piece:
                raise AssertionError("chromium ended")
            self.buffer += piece
        line, self.buffer = self.buffer.split(b"\0", 1)
        return json.loads(line)

    def call(self, method, session=None, **parameters):
        self.number += 1
        message = {"id": self.number, "method": method, "params": parameters}
        if session:
            message["sessionId"] = session
        data = json.dumps(message).encode() + b"\0"
        while data:
            data = data[os.write(self.write, data):]
        until = time.monotonic() + LIMIT_S
        while answer := self.receive(until):
            if answer.get("id") == self.number:
                if "error" in answer:
                    raise AssertionError(f"{method}: {answer['error']}")
                return answer["result"]
            self.note(answer)
        raise AssertionError(f"{method}: chromium did not answer within {LIMIT_S} s")

    def note(self, event):
        page, told = self.pages.get(event.get("sessionId")), event.get("params", {})
        if page and event["method"] == "Runtime.exceptionThrown":
            details = told["exceptionDetails"]
            page.says.append(details.get("exception", {}).get("description") or details["text"])
        elif page and event["method"] == "Runtime.consoleAPICalled" and told["type"] == "error":
            page.says.append(str([a.get("value") for a in told["args"]]))

    def page(self):
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        page = Page.__new__(Page)
        self.pages[session] = page
        page.__init__(self, session)
        return page
