"""Run an untrusted script in a process that can only edit one small file.

The process has an isolated interpreter, an empty environment, no network, no other process, little memory and time, and
a scratch folder as its only files, by whatever the system offers: user, mount and network namespaces, Landlock, seccomp.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import pxr

from s2a.errors import InputError
from s2a.ranges import Count, Positive
from s2a.sandbox.policy import AllowConfig
from s2a.sandbox.violation import PolicyViolation
from s2a.sandbox.worker import GUARANTEES

START = "import sys; sys.path[:0] = sys.argv[2:]; from s2a.sandbox.worker import main; main(int(sys.argv[1]))"
STAGE = "scene.usda"
"""Name of the stage in the scratch folder, which is the current one."""


@dataclass(frozen=True)
class SandboxConfig:
    """Limits of scripts.

    Attributes:
        seconds: wall time of the process, from when it receives the script [s].
        cpu_seconds: CPU time of the script [s].
        memory: address space of the script [MiB].
        disk: size of its scratch folder and of a file [MiB].
        allow: bounds on its text.
        layers: sandbox layers to enable.
        required_guarantees: guarantees without which an untrusted script does not run; `s2a.sandbox.worker.GUARANTEES` lists
            what each layer guarantees. Require less than all three only for scripts that somebody has read.
    """

    seconds: Positive
    cpu_seconds: Positive
    memory: Count
    disk: Count
    allow: AllowConfig
    layers: tuple[Literal["namespaces", "landlock", "seccomp"], ...]
    required_guarantees: tuple[Literal["files", "network", "processes"], ...]


@dataclass(frozen=True)
class SandboxResult:
    """Result of a sandboxed run.

    Attributes:
        saved: the stage as the process returned it; untrusted.
        active: sandbox layers that were active, reported before the script began.
        seconds: from when the process received the script to its end [s].
    """

    saved: bytes
    active: tuple[str, ...]
    seconds: float


class Sandbox:
    """Runs scripts on a geometry-free stage, each in a process of its own; the first process is started ahead.

    Importing USD and enabling the layers takes 0.3 s, which overlaps with the search for a pose.

    Attributes:
        geometry_free_text: USD text of the stage, which a script finds as `scene.usda` in its current folder.
        config: limits and sandbox layers.
        trusted: Run scripts on systems that lack the required guarantees.
    """

    def __init__(self, geometry_free_text: str, config: SandboxConfig, trusted: bool) -> None:
        self.geometry_free_text, self.config, self.trusted = geometry_free_text, config, trusted
        self._ahead: _Process | None = None

    def __enter__(self) -> Sandbox:
        """Start a process for the first script."""
        self._ahead = _Process(self)
        return self

    def __exit__(self, *_: object) -> None:
        """End a process that still waits for a script."""
        if self._ahead is not None:
            self._ahead.end()

    def run(self, script: str, names: dict[str, str]) -> SandboxResult:
        """Run a script.

        Args:
            script: Python, unchecked.
            names: texts that the script finds in variables of these names.

        Raises:
            PolicyViolation: the script failed, or used more than it may.
            InputError: the system cannot confine an untrusted script.
        """
        process, self._ahead = self._ahead or _Process(self), None
        start = time.perf_counter()
        try:
            code, reports = process.run(json.dumps({"script": script, "names": names}), self.config.seconds)
            seconds = time.perf_counter() - start
            active, error = _verdict(code, reports, self.config, self.trusted)
            if error:
                raise error
            return SandboxResult(process.saved(), active, seconds)
        finally:
            process.end()


class _Process:
    """A process that enables its sandbox layers and waits for its script."""

    def __init__(self, sandbox: Sandbox) -> None:
        config, self._open = sandbox.config, ExitStack()
        scratch = self._open.enter_context(tempfile.TemporaryDirectory(prefix="s2a."))
        self._out = self._open.enter_context(tempfile.TemporaryFile())
        reader, writer = os.pipe()
        self._reports = self._open.enter_context(open(reader, "rb"))
        job = {
            "report": writer,
            "scratch": scratch,
            "stage": STAGE,
            "stage_text": sandbox.geometry_free_text,
            "layers": config.layers,
            "required_guarantees": () if sandbox.trusted else config.required_guarantees,
            "cpu_seconds": config.cpu_seconds,
            "memory": config.memory,
            "disk": config.disk,
        }
        folders = (str(Path(__file__).parents[2]), str(Path(pxr.__file__).parents[1]))
        # A file, for a pipe holds less than a skeleton.
        with tempfile.TemporaryFile() as file:
            file.write(json.dumps(job).encode())
            file.seek(0)
            self._process = subprocess.Popen(
                [sys.executable, "-I", "-S", "-B", "-c", START, str(file.fileno()), *folders],
                stdin=subprocess.PIPE,
                stdout=self._out,
                stderr=subprocess.DEVNULL,
                pass_fds=[writer, file.fileno()],
                env={},
                cwd=scratch,
            )
        os.close(writer)

    def run(self, text: str, seconds: float) -> tuple[int | None, list[str]]:
        """Hand over the script, and wait; return the exit code (None: it had to be ended) and the lines it reported."""
        try:
            self._process.communicate(text.encode(), timeout=seconds)
            code: int | None = self._process.returncode
        except subprocess.TimeoutExpired:
            self._process.kill()
            code = None
        return code, self._reports.read(1 << 16).decode(errors="replace").splitlines()

    def saved(self) -> bytes:
        """Return the stage as the process handed it back."""
        self._out.seek(0)
        return self._out.read()

    def end(self) -> None:
        """Kill the process and delete its files."""
        self._process.kill()
        self._process.wait()
        if self._process.stdin:
            self._process.stdin.close()
        self._open.close()


def _verdict(
    code: int | None, reports: list[str], config: SandboxConfig, trusted: bool
) -> tuple[tuple[str, ...], Exception | None]:
    """Return the active layers, and the exception to raise if the script failed."""
    if not reports:
        reason = (
            f"ended with {code} before it could start" if code is not None else f"did not start in {config.seconds} s"
        )
        return (), InputError(f"the process that confines scripts {reason}; try again, or raise sandbox.seconds")
    active = tuple(json.loads(reports[0])["active"])
    missing = [
        what for what in config.required_guarantees if what not in {w for lock in active for w in GUARANTEES[lock]}
    ]
    if missing and not trusted:
        return active, InputError(
            f"this system cannot keep {', '.join(missing)} from a script (active sandbox layers: {', '.join(active) or 'none'}); "
            f"use llm=rules, or give sandbox.required_guarantees=[] if you trust the scripts' author"
        )
    if code is None:
        return active, PolicyViolation("process", f"it ran longer than {config.seconds:g} s")
    if code or len(reports) < 2:
        return active, PolicyViolation(
            "process", f"its process was ended ({code}): too much time, memory or disk, or a crash"
        )
    return active, _failure(reports[1])


def _failure(report: str) -> PolicyViolation | None:
    """Return the violation that the script's process reports; untrusted, so shortened and cleaned."""
    try:
        said = json.loads(report)
        line, reason = said.get("line"), said.get("reason")
    except (ValueError, AttributeError):
        return PolicyViolation("process", "its report cannot be read")
    if reason is None:
        return None
    clean = "".join(letter if letter.isprintable() else " " for letter in str(reason)[:300])
    return PolicyViolation("process", clean, line if isinstance(line, int) else None)
