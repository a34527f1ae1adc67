"""A headless Chromium, controlled through pipes: no other library, no port, no network.

The package does not need Chromium. Without Chromium, tests that use it are skipped.
"""

import base64
import itertools
import json
import os
import shutil
import subprocess

FOUND = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
)
FLAGS = ("--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--remote-debugging-pipe")


class Browser:
    """One page of a browser; `events` are its messages, such as requests and errors."""

    def __init__(self, profile):
        there, self._to = os.pipe()
        self._from, back = os.pipe()
        ends = f'exec 3<&{there} 4>&{back}; exec "$0" "$@"'
        command = ["bash", "-c", ends, FOUND, *FLAGS, f"--user-data-dir={profile}", "about:blank"]
        quiet = subprocess.DEVNULL
        self._process = subprocess.Popen(
            command, pass_fds=(there, back), stdout=quiet, stderr=quiet
        )
        os.close(there)
        os.close(back)
        self._numbers, self._rest, self.events, self._session = itertools.count(1), b"", [], {}
        targets = self("Target.getTargets")["targetInfos"]
        page = next(one["targetId"] for one in targets if one["type"] == "page")
        session = self("Target.attachToTarget", targetId=page, flatten=True)["sessionId"]
        self._session = {"sessionId": session}
        for domain in ("Page", "Runtime", "Network", "Log"):
            self(f"{domain}.enable")
        window = {"width": 1000, "height": 1600, "deviceScaleFactor": 1, "mobile": False}
        self("Emulation.setDeviceMetricsOverride", **window)

    def __call__(self, method, **params):
        """Send a command and return its result."""
        number = next(self._numbers)
        asked = {"id": number, "method": method, "params": params} | self._session
        os.write(self._to, json.dumps(asked).encode() + b"\0")
        while (told := self._read()).get("id") != number:
            self.events.append(told)
        assert "error" not in told, told
        return told["result"]

    def _read(self):
        while b"\0" not in self._rest:
            more = os.read(self._from, 1 << 20)
            assert more, "the browser has ended"
            self._rest += more
        told, _, self._rest = self._rest.partition(b"\0")
        return json.loads(told)

    def open(self, path):
        """Open a file and wait until it is loaded."""
        self("Page.navigate", url=path.as_uri())
        while not any(one["method"] == "Page.loadEventFired" for one in self.events):
            self.events.append(self._read())

    def js(self, expression):
        """Return the value of an expression on the page."""
        told = self(
            "Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True
        )
        assert "exceptionDetails" not in told, told
        return told["result"].get("value")

    def press(self, key, text=""):
        """Press and release a key."""
        self("Input.dispatchKeyEvent", type="keyDown", key=key, code=key, text=text)
        self("Input.dispatchKeyEvent", type="keyUp", key=key, code=key)

    def click(self, x, y):
        for kind in ("mousePressed", "mouseReleased"):
            self("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def picture(self, path):
        path.write_bytes(base64.b64decode(self("Page.captureScreenshot")["data"]))

    def close(self):
        self("Browser.close") if self._process.poll() is None else None
        self._process.wait()
        os.close(self._to)
        os.close(self._from)
