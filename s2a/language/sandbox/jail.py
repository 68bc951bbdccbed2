"""Run an untrusted script in a process that can only edit one small file.

The process has an isolated interpreter, an empty environment, no network, no other process, little memory and time, and
a scratch folder as its only files, by whatever the system offers: user, mount and network namespaces, Landlock, seccomp.
"""

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
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

import newton_usd_schemas
import numpy as np
import pxr
from pxr import Sdf

import s2a
from s2a.core.bounds import Count, Positive
from s2a.core.errors import InputError, printable
from s2a.core.outputs import temporary_folder
from s2a.language.sandbox.diff import Placement
from s2a.language.sandbox.operations import PolicyViolation
from s2a.language.sandbox.policy import AllowConfig
from s2a.language.sandbox.worker import GUARANTEES, INODES, MEBIBYTE

START = "import sys; sys.path[:0] = sys.argv[2:]; from s2a.language.sandbox.{} import main; main(int(sys.argv[1]))"
REPORT = 1 << 16  # Longest report that is read [bytes]
POLL_INTERVAL = 0.1  # Time between looks at the scratch folder [s]


class Process:
    """An isolated interpreter with an empty environment, which runs `main` of a module of `s2a.language.sandbox`.

    It has a scratch folder, and descriptors for its job, its reports and its result; what it prints is dropped, but for the
    last line of its errors, should it not start.

    Args:
        module: "worker" or "comparer".
        job: plain values for it; the scratch folder and the descriptors are added.
    """

    def __init__(self, module: str, job: dict[str, Any]) -> None:
        self._open = ExitStack()
        own = self._open.enter_context(temporary_folder())  # which the next start deletes, should this one be killed
        scratch = self._scratch = self._open.enter_context(tempfile.TemporaryDirectory(dir=own))
        self._disk = job["disk"] * MEBIBYTE
        self._result, self._errors = (self._open.enter_context(tempfile.TemporaryFile()) for _ in range(2))
        reader, writer = os.pipe()
        self._reports = self._open.enter_context(open(reader, "rb", buffering=0))
        passed = {"report": writer, "result": self._result.fileno()}
        # Of each package that it imports: they need not lie in one folder (a system's numpy, USD by pip --target).
        folders = dict.fromkeys(
            str(Path(str(package.__file__)).parents[1]) for package in (s2a, pxr, np, newton_usd_schemas)
        )
        # A file, for a pipe holds less than a geometry-free stage.
        with tempfile.TemporaryFile() as file:
            file.write(json.dumps({**job, **passed, "scratch": scratch}).encode())
            file.seek(0)
            self._process = subprocess.Popen(
                [sys.executable, "-I", "-S", "-B", "-c", START.format(module), str(file.fileno()), *folders],
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=self._errors,
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

    @property
    def error(self) -> str:
        """The last line that it wrote to its standard error, shortened; empty without one."""
        self._errors.seek(0)
        lines = self._errors.read(REPORT).decode(errors="replace").split("\n")
        return printable(next((line for line in reversed(lines) if line.strip()), ""))[: REASON["process"]]

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


EXPOSED = ("existence, size, owner and times of files outside the scratch folder",)  # What only namespaces hide
Task = Literal["worker", "comparer"]
# Characters of a reported reason that are kept, and the highest line that is believed
REASON, MOST_LINES = {"process": 300, "comparison": 1000}, 1_000_000
STARTING = 30.0  # Longest time in which a process enables its layers [s]
STAGE = "scene.usda"  # Name of the stage in the scratch folder, which is the current one


@dataclass(frozen=True, kw_only=True)
class SandboxConfig:
    """Limits of scripts.

    Attributes:
        seconds: wall time of the process, from when it receives the script [s].
        cpu_seconds: CPU time of the script [s].
        memory: address space of the script [MiB]. MiB.
        disk: size of its scratch folder and of a file [MiB]. MiB; the geometry-free stage of a full office has 0.2.
        allow: bounds on its text.
        layers: sandbox layers to enable.
        required_guarantees: guarantees without which an untrusted script does not run; `s2a.language.sandbox.worker.GUARANTEES`
        lists
            what each layer guarantees. Require less than all three only for scripts that somebody has read.
    """

    seconds: Positive
    cpu_seconds: Positive = 3.0
    memory: Count = 256
    disk: Count = 2
    allow: AllowConfig = AllowConfig()
    layers: tuple[Literal["namespaces", "landlock", "seccomp"], ...]
    required_guarantees: tuple[Literal["files", "network", "processes"], ...]


@dataclass(frozen=True)
class SandboxResult:
    """Result of a sandboxed run."""

    saved: bytes  # the stage as the process returned it; untrusted
    active: tuple[str, ...]  # sandbox layers that were active, reported before the script began
    exposed: tuple[str, ...]  # what a script could see of the system all the same
    seconds: float  # from when the process received the script to its end [s]


class Sandbox:
    """Runs scripts on a geometry-free stage and compares their results with the plan, each in a process of its own.

    The first processes are started ahead: importing USD and enabling the layers takes 0.3 s, which overlaps with the search
    for a pose.

    Attributes:
        geometry_free_text: USD text of the stage, which a script finds as `scene.usda` in its current folder.
        config: limits and sandbox layers.
        trusted: Run scripts on systems that lack the required guarantees.
    """

    def __init__(self, geometry_free_text: str, config: SandboxConfig, trusted: bool) -> None:
        self.geometry_free_text, self.config, self.trusted = geometry_free_text, config, trusted
        self._ahead: dict[Task, Process] = {}

    def __enter__(self) -> Sandbox:
        """Start the processes for the first script."""
        try:
            for task in ("worker", "comparer"):
                self._ahead[task] = self._start(task)
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        """End the processes that still wait for a script."""
        for process in self._ahead.values():
            process.end()
        self._ahead.clear()

    def check_guarantees(self) -> None:
        """Raise an InputError if this system cannot confine an untrusted script: before somebody is paid for writing one."""
        if not self.trusted and "worker" in self._ahead:
            self._ready(self._ahead["worker"])

    def run(self, script: str, names: dict[str, str]) -> SandboxResult:
        """Run a script.

        `names`: texts that the script finds in variables of these names.

        Raises:
            PolicyViolation: the script failed, or used more than it may.
            InputError: the system cannot confine an untrusted script.
        """
        process = self._take("worker")
        try:
            active = self._ready(process)
            start = time.perf_counter()
            code, report = process.run({"script": script, "names": names}, self.config.seconds)
            seconds = time.perf_counter() - start
            if code is None:
                raise PolicyViolation("process", f"it ran longer than {self.config.seconds:g} s")
            if code or report is None:
                raise PolicyViolation(
                    "process", f"its process was ended ({code}): too much time, memory or disk, or a crash"
                )
            if failure := _failure(report, "process"):
                raise failure
            return SandboxResult(process.result(), active, () if "namespaces" in active else EXPOSED, seconds)
        finally:
            process.end()

    def compare(self, saved: bytes, plan: Placement) -> Sdf.Layer:
        """Return a layer that holds the planned prim as a script wrote it (`s2a.language.sandbox.diff.compare`).

        `saved`: the stage as the script saved it; untrusted.

        Raises:
            PolicyViolation: the stage differs from the plan, or whoever reads it comes to grief.
            InputError: the process that compares cannot be started.
        """
        process = self._take("comparer")
        try:
            self._ready(process, guarantees=False)
            try:
                text = saved.decode()
            except UnicodeDecodeError as error:
                raise PolicyViolation(
                    "comparison", "the saved stage is not USD text: save it, do not rewrite it"
                ) from error
            code, report = process.run({"saved": text, "plan": asdict(plan)}, self.config.seconds)
            if code or code is None or report is None:
                raise PolicyViolation(
                    "comparison",
                    f"the saved stage is not USD text that can be read (its reader ended with {code}): "
                    "save it, do not rewrite it",
                )
            if failure := _failure(report, "comparison"):
                raise failure
            layer = Sdf.Layer.CreateAnonymous(".usda")
            layer.ImportFromString(process.result().decode())
            return layer
        finally:
            process.end()

    def _take(self, task: Task) -> Process:
        """Return the process that was started ahead, or a new one."""
        return self._ahead.pop(task, None) or self._start(task)

    def _start(self, task: Task) -> Process:
        config = self.config
        job: dict[str, Any] = {
            "stage": STAGE,
            "stage_text": self.geometry_free_text,
            "layers": config.layers,
            "cpu_seconds": config.cpu_seconds if task == "worker" else config.seconds,
            "memory": config.memory,
            "disk": config.disk,
        }
        return Process(task, job)

    def _ready(self, process: Process, guarantees: bool = True) -> tuple[str, ...]:
        """Return the active layers of a process, once it has enabled them; raise an InputError if they do not suffice."""
        active = process.active(STARTING)
        if active is None:
            why = f": {process.error}" if process.error else "; check the free memory and disk, try again"
            raise InputError(f"the process that confines scripts did not start{why}")
        guaranteed = {what for layer in active for what in GUARANTEES[layer]}
        missing = [what for what in self.config.required_guarantees if what not in guaranteed]
        if missing and guarantees and not self.trusted:
            raise InputError(
                f"this system cannot keep {', '.join(missing)} from a script "
                f"(active sandbox layers: {', '.join(active) or 'none'}); "
                f"use llm=rules, or give sandbox.required_guarantees=[] if you trust the scripts' author"
            )
        return active


def _failure(report: str, step: Literal["process", "comparison"]) -> PolicyViolation | None:
    """Return the violation that a process reports; untrusted, so shortened and cleaned."""
    try:
        failure = json.loads(report)
        line, reason = failure.get("line"), failure.get("reason")
    except (ValueError, AttributeError, RecursionError):
        return PolicyViolation(step, "its report cannot be read")
    if reason is None:
        return None
    plausible = isinstance(line, int) and not isinstance(line, bool) and 0 < line < MOST_LINES
    return PolicyViolation(step, str(reason)[: REASON[step]], line if plausible else None)
