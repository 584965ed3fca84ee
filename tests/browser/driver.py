"""A browser without a window, driven over WebDriver (W3C, 2018) by the standard library.

The fixture `browser` of `tests/conftest.py` gives a `Browser` to any test. Chromium and its driver
are system packages: `./viform test` installs them.
"""

from __future__ import annotations

import base64
import http.client
import json
import os
import re
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any, Final

PROGRAMS: Final = {"chromium": "chromium", "chromedriver": "chromium-driver"}
"""Program and the Debian package that holds it."""
KEYS: Final = {
    "Tab": "\ue004", "Enter": "\ue007", "Shift": "\ue008", "Escape": "\ue00c", "Space": " ",
    "Left": "\ue012", "Right": "\ue014", "Home": "\ue011", "End": "\ue010",
}  # fmt: skip
"""Codes of keys without a character (WebDriver, table of keyboard actions)."""
_OPTIONS: Final = (
    "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage",
    "--no-first-run", "--disable-background-networking", "--disable-component-update",
)  # fmt: skip
_WAIT_S: Final = 120


def missing_programs() -> list[str]:
    """Debian packages of the programs that are not installed."""
    return [package for name, package in PROGRAMS.items() if shutil.which(name) is None]


class Browser:
    """One window of Chromium. Used as a context manager, it ends with it."""

    def __init__(self) -> None:
        self._folder = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        home = {"HOME": self._folder.name}  # crash reports and caches of the browser
        self._process = subprocess.Popen(
            [shutil.which("chromedriver") or "chromedriver", "--port=0"],
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=os.environ | home,
        )  # fmt: skip
        try:
            self._port = self._read_port()
            options = [*_OPTIONS, f"--user-data-dir={self._folder.name}/profile"]
            wanted = {
                "goog:chromeOptions": {"args": options, "binary": shutil.which("chromium")},
                "goog:loggingPrefs": {"browser": "ALL", "performance": "ALL"},
            }
            self._session = ""
            opened = self._ask("POST", "/session", {"capabilities": {"alwaysMatch": wanted}})
            self._session = f"/session/{opened['sessionId']}"
        except BaseException:
            self._end()
            raise

    def __enter__(self) -> Browser:
        return self

    def __exit__(self, *_: object) -> None:
        try:
            self._ask("DELETE", "")
        finally:
            self._end()

    def _end(self) -> None:
        self._process.terminate()
        self._process.communicate()
        self._folder.cleanup()

    def _read_port(self) -> int:
        assert self._process.stdout is not None
        said = []
        for line in self._process.stdout:
            said.append(line)
            if found := re.search(r"started successfully on port (\d+)", line):
                return int(found[1])
        raise RuntimeError(f"chromedriver did not start: {''.join(said)}")

    def _ask(self, method: str, path: str, body: Any = None) -> Any:
        connection = http.client.HTTPConnection("127.0.0.1", self._port, timeout=_WAIT_S)
        try:
            text = None if method != "POST" else json.dumps(body or {})
            connection.request(method, self._session + path, text)
            value = json.loads(connection.getresponse().read())["value"]
        finally:
            connection.close()
        if isinstance(value, dict) and "error" in value:
            raise RuntimeError(f"{value['error']}: {value['message'].splitlines()[0]}")
        return value

    def open(self, page: Path) -> None:
        """Opens a file and forgets what was logged before."""
        self.go(page.resolve().as_uri())

    def go(self, address: str) -> None:
        """Opens an address and forgets what was logged before."""
        self._log("browser")
        self._log("performance")
        self._ask("POST", "/url", {"url": address})

    def run(self, script: str, *arguments: Any) -> Any:
        """What a JavaScript function body returns; a promise is awaited."""
        return self._ask("POST", "/execute/sync", {"script": script, "args": list(arguments)})

    def command(self, name: str, **parameters: Any) -> Any:
        """A command of the Chrome DevTools protocol."""
        return self._ask("POST", "/goog/cdp/execute", {"cmd": name, "params": parameters})

    def resize(self, width: int, height: int) -> None:
        """The size of what the page sees, pixels."""
        self.command(
            "Emulation.setDeviceMetricsOverride", width=width, height=height,
            deviceScaleFactor=1, mobile=False,
        )  # fmt: skip
        self.settle()

    def settle(self) -> None:
        """Waits until the page has seen a change of its size and is drawn anew: two frames."""
        self.run("return new Promise(f => requestAnimationFrame(() => requestAnimationFrame(f)))")

    def media(self, kind: str = "", **features: str) -> None:
        """Emulates a medium ("print") and features (prefers_color_scheme="dark")."""
        named = [{"name": k.replace("_", "-"), "value": v} for k, v in features.items()]
        self.command("Emulation.setEmulatedMedia", media=kind, features=named)
        self.settle()

    def click(self, selector: str) -> None:
        """Clicks the first element that a CSS selector finds, scrolled into view."""
        found = self._ask("POST", "/element", {"using": "css selector", "value": selector})
        self._ask("POST", f"/element/{next(iter(found.values()))}/click")

    def press(self, *keys: str) -> None:
        """Presses keys one after another: characters, or names of `KEYS`."""
        strokes = [
            {"type": kind, "value": KEYS.get(key, key)}
            for key in keys
            for kind in ("keyDown", "keyUp")
        ]
        keyboard = {"type": "key", "id": "keyboard", "actions": strokes}
        self._ask("POST", "/actions", {"actions": [keyboard]})

    def screenshot(self, path: Path | None = None, *, whole: bool = False) -> bytes:
        """A PNG of what is in view, or of the whole page; also written to `path`."""
        how = {"format": "png", "captureBeyondViewport": whole}
        if whole:
            size = self.command("Page.getLayoutMetrics")["cssContentSize"]
            how["clip"] = {**size, "scale": 1}
        picture = base64.b64decode(self.command("Page.captureScreenshot", **how)["data"])
        if path is not None:
            path.write_bytes(picture)
        return picture

    def pdf(self) -> bytes:
        """The page as it is printed."""
        return base64.b64decode(self._ask("POST", "/print", {"background": False}))

    def complaints(self) -> list[str]:
        """Messages of the console since `open`: errors and warnings, of scripts and of policies."""
        return [
            entry["message"] for entry in self._log("browser")
            if entry["level"] in ("SEVERE", "WARNING")
        ]  # fmt: skip

    def requests(self) -> list[str]:
        """Addresses that the page has asked for since `open`, other than data within it."""
        sent = [json.loads(entry["message"])["message"] for entry in self._log("performance")]
        urls = [
            event["params"]["request"]["url"] for event in sent
            if event["method"] == "Network.requestWillBeSent"
        ]  # fmt: skip
        return [url for url in urls if not url.startswith("data:")]

    def _log(self, kind: str) -> Any:
        return self._ask("POST", "/se/log", {"type": kind})
