"""Run a script that nobody has read in a process that can do nothing but edit one small file.

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
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Literal

import pxr

import s2a
from s2a.edit.allow import AllowConfig
from s2a.edit.inside import OFFERS
from s2a.edit.refusal import Refusal
from s2a.errors import InputError

START = "import sys; sys.path[:0] = sys.argv[1:]; from s2a.edit.inside import main; main()"
STAGE = "scene.usda"
"""Name of the stage in the scratch folder, which is the current one."""


@dataclass(frozen=True)
class ConfinementConfig:
    """What a script may say and use.

    Attributes:
        seconds: until the process is ended, from its start [s].
        cpu_seconds: of one core for the script alone [s].
        memory: address space for the script [MiB].
        disk: size of its scratch folder, and of a file [MiB].
        allow: what its text may hold.
        mechanisms: which locks to try.
        needs: what must be kept from an untrusted script, or it is not run; what a lock keeps away is in
            `s2a.edit.inside.OFFERS`. Less than all three is a risk to take only for scripts that somebody has read.
    """

    seconds: float
    cpu_seconds: float
    memory: int
    disk: int
    allow: AllowConfig
    mechanisms: tuple[Literal["namespaces", "landlock", "seccomp"], ...]
    needs: tuple[Literal["files", "network", "processes"], ...]


@dataclass(frozen=True)
class Confined:
    """What came of a confined run.

    Attributes:
        saved: the stage as the process handed it back: whatever the script made it say.
        active: the locks that held, from a report sent before the script began.
        seconds: from start to end of the process [s].
    """

    saved: bytes
    active: tuple[str, ...]
    seconds: float


def confine(script: str, skeleton: str, names: dict[str, str], config: ConfinementConfig, trusted: bool) -> Confined:
    """Run a script on a stage in a process of its own.

    Args:
        script: Python, unchecked.
        skeleton: text of the stage, which the script finds as `scene.usda` in its current folder.
        names: texts that the script finds in variables of these names.
        config: limits and locks.
        trusted: run it although the system lacks locks.

    Raises:
        Refusal: the script failed, or used more than it may.
        InputError: the system cannot confine an untrusted script.
    """
    job = {
        "script": script,
        "names": names,
        "stage": STAGE,
        "skeleton": skeleton,
        "mechanisms": config.mechanisms,
        "needs": () if trusted else config.needs,
        "cpu_seconds": config.cpu_seconds,
        "memory": config.memory,
        "disk": config.disk,
    }
    with tempfile.TemporaryDirectory(prefix="s2a.") as scratch, tempfile.TemporaryFile() as out:
        start = time.perf_counter()
        code, reports = _run({**job, "scratch": scratch}, out, config.seconds)
        seconds = time.perf_counter() - start
        out.seek(0)
        active, error = _judge(code, reports, config, trusted)
        if error:
            raise error
        return Confined(out.read(), active, seconds)


def _run(job: dict[str, Any], out: IO[bytes], seconds: float) -> tuple[int | None, list[str]]:
    """Start the process and wait for it; return its exit code (None: it had to be ended) and the lines it reported."""
    folders = (str(Path(s2a.__file__).parents[1]), str(Path(pxr.__file__).parents[1]))
    command = [sys.executable, "-I", "-S", "-B", "-c", START, *folders]
    reader, writer = os.pipe()
    with open(reader, "rb") as reports:
        text = json.dumps({**job, "report": writer}).encode()
        try:
            code: int | None = subprocess.run(
                command,
                input=text,
                stdout=out,
                stderr=subprocess.DEVNULL,
                pass_fds=[writer],
                env={},
                cwd=job["scratch"],
                timeout=seconds,
            ).returncode
        except subprocess.TimeoutExpired:
            code = None
        finally:
            os.close(writer)
        return code, reports.read(1 << 16).decode(errors="replace").splitlines()


def _judge(
    code: int | None, reports: list[str], config: ConfinementConfig, trusted: bool
) -> tuple[tuple[str, ...], Exception | None]:
    """Return the locks that held, and what to raise if the script did not end well."""
    if not reports:
        reason = (
            f"ended with {code} before it could start" if code is not None else f"did not start in {config.seconds} s"
        )
        return (), InputError(f"the process that confines scripts {reason}; try again, or raise confinement.seconds")
    active = tuple(json.loads(reports[0])["active"])
    missing = [what for what in config.needs if what not in {w for lock in active for w in OFFERS[lock]}]
    if missing and not trusted:
        return active, InputError(
            f"this system cannot keep {', '.join(missing)} from a script (locks that hold: {', '.join(active) or 'none'}); "
            f"use llm=rules, or give confinement.needs=[] if you trust the scripts' author"
        )
    if code is None:
        return active, Refusal("process", f"it ran longer than {config.seconds:g} s")
    if code or len(reports) < 2:
        return active, Refusal("process", f"its process was ended ({code}): too much time, memory or disk, or a crash")
    return active, _failure(reports[1])


def _failure(report: str) -> Refusal | None:
    """Return what the script's process says went wrong with it; hardly to be trusted, so cut and cleaned."""
    try:
        said = json.loads(report)
        line, reason = said.get("line"), said.get("reason")
    except (ValueError, AttributeError):
        return Refusal("process", "its report cannot be read")
    if reason is None:
        return None
    clean = "".join(letter if letter.isprintable() else " " for letter in str(reason)[:300])
    return Refusal("process", clean, line if isinstance(line, int) else None)
