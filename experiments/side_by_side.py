"""Commands run side by side on the GPUs of this machine, until they end or time is up."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Sequence
from pathlib import Path

import torch

GRACE = 10.0
"""Seconds that a command is given to stop; by so much the deadline can be overrun."""


def gpu_slots(side_by_side: int) -> list[str]:
    """Return what each command that runs at a time sees of the GPUs (CUDA_VISIBLE_DEVICES); without a GPU, none.

    Args:
        side_by_side: how many commands share a GPU.
    """
    allowed = os.environ.get("CUDA_VISIBLE_DEVICES")
    gpus = allowed.split(",") if allowed else [str(i) for i in range(torch.cuda.device_count())]
    return gpus * side_by_side or [""] * side_by_side


def run(commands: Sequence[tuple[list[str], Path]], slots: Sequence[str], deadline: float) -> list[Path]:
    """Run commands until all have ended or time is up; what still runs then is interrupted, as by Ctrl-C.

    Args:
        commands: arguments, and the file to which what the command says is added.
        slots: CUDA_VISIBLE_DEVICES of each command that runs at a time.
        deadline: time.monotonic() at which to stop.

    Returns:
        The files of the commands that failed by themselves.
    """
    waiting, failed = list(commands), []
    active: dict[int, tuple[subprocess.Popen, Path]] = {}
    try:
        while (waiting or active) and time.monotonic() < deadline:
            for slot, gpu in enumerate(slots):
                if slot in active and active[slot][0].poll() is not None:
                    process, log = active.pop(slot)
                    failed += [log] if process.returncode else []
                if slot not in active and waiting:
                    command, log = waiting.pop(0)
                    active[slot] = _start(command, log, gpu), log
            time.sleep(0.2)
    finally:
        _stop([process for process, _ in active.values()])
    return failed


def _start(command: list[str], log: Path, gpu: str) -> subprocess.Popen:
    """Start a command in a process group of its own, which can be interrupted as a whole."""
    log.parent.mkdir(parents=True, exist_ok=True)
    environment = os.environ | {"CUDA_VISIBLE_DEVICES": gpu}
    with log.open("a") as file:
        return subprocess.Popen(command, env=environment, stdout=file, stderr=file, start_new_session=True)


def _stop(processes: Sequence[subprocess.Popen]) -> None:
    """Interrupt what still runs, and kill what does not heed it."""
    for sign in (signal.SIGINT, signal.SIGKILL):
        for process in (process for process in processes if process.poll() is None):
            os.killpg(process.pid, sign)
        end = time.monotonic() + GRACE
        while any(process.poll() is None for process in processes) and time.monotonic() < end:
            time.sleep(0.1)
