"""A process that enables its sandbox layers, waits for one task, and reports."""

from __future__ import annotations

import json
import os
import select
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import pxr

from s2a.core.outputs import temporary_folder
from s2a.language.sandbox.layers import INODES, MEBIBYTE

START = "import sys; sys.path[:0] = sys.argv[2:]; from s2a.language.sandbox.{} import main; main(int(sys.argv[1]))"
REPORT = 1 << 16
"""Longest report that is read [bytes]."""
POLL_INTERVAL = 0.1
"""Time between looks at the scratch folder [s]."""


class Process:
    """An isolated interpreter with an empty environment, which runs `main` of a module of `s2a.language.sandbox`.

    It has a scratch folder, and descriptors for its job, its reports and its result; what it prints is dropped.

    Args:
        module: "worker" or "comparer".
        job: plain values for it; the scratch folder and the descriptors are added.
    """

    def __init__(self, module: str, job: dict[str, Any]) -> None:
        self._open = ExitStack()
        own = self._open.enter_context(temporary_folder())  # which the next start deletes, should this one be killed
        scratch = self._scratch = self._open.enter_context(tempfile.TemporaryDirectory(dir=own))
        self._disk = job["disk"] * MEBIBYTE
        self._result = self._open.enter_context(tempfile.TemporaryFile())
        reader, writer = os.pipe()
        self._reports = self._open.enter_context(open(reader, "rb", buffering=0))
        passed = {"report": writer, "result": self._result.fileno()}
        folders = (str(Path(__file__).parents[3]), str(Path(pxr.__file__).parents[1]))
        # A file, for a pipe holds less than a geometry-free stage.
        with tempfile.TemporaryFile() as file:
            file.write(json.dumps({**job, **passed, "scratch": scratch}).encode())
            file.seek(0)
            self._process = subprocess.Popen(
                [sys.executable, "-I", "-S", "-B", "-c", START.format(module), str(file.fileno()), *folders],
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                pass_fds=[*passed.values(), file.fileno()],
                env={},
                cwd=scratch,
            )
        os.close(writer)
        self._active: tuple[str, ...] | None = None

    def active(self, seconds: float) -> tuple[str, ...] | None:
        """Wait until the sandbox layers are enabled, and return the active ones; None if that took longer or failed."""
        if self._active is None and select.select([self._reports], [], [], seconds)[0]:
            line = self._reports.read(REPORT)
            self._active = tuple(json.loads(line)["active"]) if line else None
        return self._active

    def run(self, task: dict[str, Any], seconds: float) -> tuple[int | None, str | None]:
        """Hand over the task, and wait; return the exit code (None: it took too long) and the line it reported, if any.

        The process is ended when its scratch folder grows beyond its bounds, which only namespaces enforce by themselves.
        """
        text: bytes | None = json.dumps(task).encode()
        deadline = time.monotonic() + seconds
        code: int | None = None
        while code is None and time.monotonic() < deadline:
            try:
                self._process.communicate(text, timeout=max(0.0, min(POLL_INTERVAL, deadline - time.monotonic())))
                code = self._process.returncode
            except subprocess.TimeoutExpired:
                text = None  # it has been handed over
            if self._overfull():
                self._process.kill()
                code = -signal.SIGXFSZ
        self._process.kill()
        lines = (self._reports.read(REPORT) or b"").decode(errors="replace").splitlines()
        return code, lines[0] if lines else None

    def _overfull(self) -> bool:
        """Return True if the scratch folder, where it can be seen, holds more than it may."""
        count = size = 0
        for folder, folders, files in os.walk(self._scratch):
            count += len(folders) + len(files)
            for name in files:
                with suppress(OSError):
                    size += os.lstat(os.path.join(folder, name)).st_blocks * 512
            if count > INODES or size > self._disk:
                return True
        return False

    def result(self) -> bytes:
        """Return what the process handed back; a file, whose size its limits bound."""
        self._result.seek(0)
        return self._result.read()

    def end(self) -> None:
        """Kill the process and delete its files."""
        self._process.kill()
        self._process.wait()
        if self._process.stdin:
            self._process.stdin.close()
        self._open.close()
