"""Run an untrusted script in a process that can only edit one small file.

The process has an isolated interpreter, an empty environment, no network, no other process, little memory and time, and
a scratch folder as its only files, by whatever the system offers: user, mount and network namespaces, Landlock, seccomp.
"""

from __future__ import annotations

import json
import time
from dataclasses import asdict, dataclass
from typing import Any, Literal

from pxr import Sdf

from s2a.core.errors import InputError
from s2a.core.ranges import Count, Positive
from s2a.language.insert.placement import Placement
from s2a.language.sandbox.policy import AllowConfig
from s2a.language.sandbox.process import Process
from s2a.language.sandbox.violation import PolicyViolation
from s2a.language.sandbox.worker import GUARANTEES

EXPOSED = ("existence, size, owner and times of files outside the scratch folder",)
"""What only namespaces hide."""
Task = Literal["worker", "comparer"]
REASON, MOST_LINES = {"process": 300, "comparison": 1000}, 1_000_000
"""Characters of a reported reason that are kept, and the highest line that is believed."""
STARTING = 30.0
"""Longest time in which a process enables its layers [s]."""
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
        required_guarantees: guarantees without which an untrusted script does not run; `s2a.language.sandbox.worker.GUARANTEES`
        lists
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
        exposed: what a script could see of the system all the same.
        seconds: from when the process received the script to its end [s].
    """

    saved: bytes
    active: tuple[str, ...]
    exposed: tuple[str, ...]
    seconds: float


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

        Args:
            script: Python, unchecked.
            names: texts that the script finds in variables of these names.

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

        Args:
            saved: the stage as the script saved it; untrusted.
            plan: the planned prim.

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
            raise InputError(
                "the process that confines scripts did not start; check the free memory and disk, try again"
            )
        kept = {what for layer in active for what in GUARANTEES[layer]}
        missing = [what for what in self.config.required_guarantees if what not in kept]
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
        said = json.loads(report)
        line, reason = said.get("line"), said.get("reason")
    except (ValueError, AttributeError, RecursionError):
        return PolicyViolation(step, "its report cannot be read")
    if reason is None:
        return None
    known = isinstance(line, int) and not isinstance(line, bool) and 0 < line < MOST_LINES
    return PolicyViolation(step, str(reason)[: REASON[step]], line if known else None)
