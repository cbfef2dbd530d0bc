"""Headless Chromium for pictures of a page, controlled with the DevTools protocol over two pipes.

This needs no driver and no library: messages are JSON, each terminated by a zero byte.
"""

import base64
import json
import os
import select
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Self

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
_PATIENCE = 60.0  # s, for an answer
_LARGEST = 1 << 20  # bytes read at once
_OPTIONS = (
    "--headless=new", "--disable-gpu", "--disable-dev-shm-usage", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--no-first-run", "--hide-scrollbars",
    "--host-resolver-rules=MAP * ~NOTFOUND",  # no network
    "--remote-debugging-pipe",
)  # fmt: skip
# The browser reads from file descriptor 3 and writes to 4.
_LAUNCH = """
import os, sys
from fcntl import F_DUPFD, fcntl
ends = [fcntl(int(end), F_DUPFD, 10) for end in sys.argv[1:3]]
for number, end in enumerate(ends, 3):
    os.dup2(end, number)
os.execv(sys.argv[3], sys.argv[3:])
"""


class ChromiumError(RuntimeError):
    """Chromium does not start, has ended or does not answer; one line."""


class Chromium:
    """A page in a browser of its own, which cannot reach any network."""

    def __init__(self, process: subprocess.Popen[bytes], out: int, back: int) -> None:
        self._process, self._out, self._back = process, out, back
        self._number, self._read, self._session = 0, bytearray(), ""

    @staticmethod
    def program() -> str | None:
        """Returns the path of the installed browser; None if there is none."""
        return next(filter(None, map(shutil.which, NAMES)), None)

    @classmethod
    @contextmanager
    def opened(cls, program: str, page: str, query: str, size: tuple[int, int]) -> Iterator[Self]:
        """Opens a page, and waits until its root element has `data-ready="yes"`.

        Parameters
        ----------
        page : the text of the page
        query : query string of its address, the part after the `?`
        size : px, width and height of the window

        Raises
        ------
        ChromiumError
            If the browser does not start, or the page is not ready within a minute.
        """
        with TemporaryDirectory(ignore_cleanup_errors=True) as folder:
            file = Path(folder) / "page.html"
            file.write_text(page, encoding="utf-8")
            with cls._started(program, folder) as found:
                found._open(f"{file.as_uri()}?{query}", size)
                yield found

    @classmethod
    @contextmanager
    def _started(cls, program: str, folder: str) -> Iterator[Self]:
        options = [*_OPTIONS, f"--user-data-dir={folder}/profile"]
        if os.geteuid() == 0:
            options.append("--no-sandbox")  # the sandbox does not work for root
        (theirs, out), (back, answers) = os.pipe(), os.pipe()
        # The browser's processes end as a group.
        words = [sys.executable, "-I", "-S", "-c", _LAUNCH, str(theirs), str(answers), program]
        process = subprocess.Popen(
            [*words, *options], pass_fds=(theirs, answers), start_new_session=True,
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        os.close(theirs)
        os.close(answers)
        try:
            yield cls(process, out, back)
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
            os.close(out)
            os.close(back)

    def _open(self, address: str, size: tuple[int, int]) -> None:
        target = self._ask("Target.createTarget", url="about:blank")["targetId"]
        attached = self._ask("Target.attachToTarget", targetId=target, flatten=True)
        self._session = attached["sessionId"]
        screen = {"width": size[0], "height": size[1], "deviceScaleFactor": 1, "mobile": False}
        self._ask("Emulation.setDeviceMetricsOverride", **screen)
        light = [{"name": "prefers-color-scheme", "value": "light"}]
        self._ask("Emulation.setEmulatedMedia", features=light)
        self._ask("Page.navigate", url=address)
        until = time.monotonic() + _PATIENCE
        while self.value("document.documentElement?.dataset.ready") != "yes":
            if time.monotonic() > until:
                raise ChromiumError("the page was not ready within a minute")
            time.sleep(0.05)

    def value(self, expression: str) -> Any:
        """Returns the value of an expression in the page.

        Raises
        ------
        ChromiumError
            If the page raises an error, or the browser has ended.
        """
        found = self._ask("Runtime.evaluate", expression=expression, returnByValue=True)
        if "exceptionDetails" in found:
            details = found["exceptionDetails"]
            words = details.get("exception", {}).get("description", details["text"])
            raise ChromiumError(f"the page failed: {words.splitlines()[0]}")
        return found["result"].get("value")

    def picture(self) -> bytes:
        """Returns a picture of the page as PNG."""
        found = self._ask("Page.captureScreenshot", format="png", optimizeForSpeed=True)
        return base64.b64decode(found["data"])

    def _ask(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Returns the answer to a command; events are skipped."""
        self._number += 1
        command = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            command["sessionId"] = self._session
        try:
            self._write(json.dumps(command).encode() + b"\0")
            while (answer := self._next()).get("id") != self._number:
                pass
        except OSError as error:
            raise ChromiumError(f"the browser has ended ({error.strerror})") from error
        if "error" in answer:
            raise ChromiumError(f"{method}: {answer['error']['message']}")
        result: dict[str, Any] = answer["result"]
        return result

    def _write(self, message: bytes) -> None:
        while message:
            message = message[os.write(self._out, message) :]

    def _next(self) -> dict[str, Any]:
        """Returns the next message of the browser."""
        while (end := self._read.find(b"\0")) < 0:
            if not select.select([self._back], [], [], _PATIENCE)[0]:
                raise ChromiumError("the browser did not answer within a minute")
            read = os.read(self._back, _LARGEST)
            if not read:
                raise ChromiumError("the browser has ended")
            self._read += read
        message: dict[str, Any] = json.loads(self._read[:end])
        del self._read[: end + 1]
        return message
