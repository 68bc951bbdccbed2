"""Locks of outputs: a file beside each that one process holds, and that names its holder."""

import errno
import fcntl
import hashlib
import json
import logging
import os
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from s2a.core.errors import InputError

MARK = "s2a-"  # By which folders and files beside outputs are known as ours
LOCK = f".{MARK}lock"  # Ending of the name of a lock
REFUSED = (errno.EACCES, errno.EPERM, errno.EROFS)  # What a place answers that may not be written
# What a file system without locks answers
WITHOUT_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP, errno.EINVAL, errno.EBADF)

_log = logging.getLogger(__name__)


@contextmanager
def held(place: Path, output: str, command: str) -> Iterator[None]:
    """Hold the lock of an output while the block runs.

    The system ends a lock (flock) with the process that holds it, also when that is killed; over NFS it holds between machines.

    `place`: the output, without links, in a folder that exists.

    Raises:
        InputError: another process holds it.
        OSError: no lock can be written.
    """
    lock, file, free = _taken(place)
    try:
        if not free:
            raise InputError(f"{output} is being written by {_holder(file)}; wait for it, or choose another path")
        try:
            _sign(lock, command)
            yield
        finally:
            with suppress(OSError):
                file.unlink()
    finally:
        os.close(lock)


def holder_within(folder: Path) -> str:
    """Return which other process writes an output inside a folder, "" for none."""
    # Unlike rglob, os.walk passes over folders that another process replaces meanwhile.
    files = (Path(place, name) for place, _, names in os.walk(folder) for name in names if name.endswith(LOCK))
    for file in files:
        with suppress(OSError):
            lock = os.open(file, os.O_RDONLY)
            try:
                fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
            except BlockingIOError:
                if _signature(file).get("process") != os.getpid():
                    return _holder(file)
            finally:
                os.close(lock)
    return ""


def contents(folder: Path) -> list[Path]:
    """Return what is in a folder, but for locks."""
    return [path for path in folder.iterdir() if not path.name.endswith(LOCK)]


def start_of(path: Path) -> str:
    """Return a name, or the start of a long one with its hash: a file system takes 255 bytes, our mark included."""
    name = os.fsencode(path.name)
    if len(name) <= 200:
        return path.name
    return f"{name[:180].decode(errors='ignore')}-{hashlib.blake2b(name, digest_size=8).hexdigest()}"


def _taken(place: Path) -> tuple[int, Path, bool]:
    """Open the lock of an output and take it; return its descriptor, its file, and whether it was free."""
    while True:
        lock, file = _opened(place)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            with suppress(FileNotFoundError):
                if os.path.samestat(os.fstat(lock), file.stat()):
                    return lock, file, True
        except BlockingIOError:
            return lock, file, False
        except OSError as error:
            if error.errno in WITHOUT_LOCKS:
                return lock, file, not _lives(file)
            os.close(lock)
            raise
        os.close(lock)  # its holder has ended meanwhile, and removed it


def _opened(place: Path) -> tuple[int, Path]:
    """Open a file beside an output, or in a folder of which only the inside may be written; return it and its path."""
    beside, inside = place.parent / f".{start_of(place)}{LOCK}", place / LOCK
    try:
        return os.open(beside, os.O_RDWR | os.O_CREAT, 0o666), beside
    except OSError as error:
        if error.errno not in REFUSED or not (beside.exists() or place.is_dir()):
            raise
    if beside.exists():  # another user's
        return os.open(beside, os.O_RDONLY), beside
    return os.open(inside, os.O_RDWR | os.O_CREAT, 0o666), inside


def _sign(lock: int, command: str) -> None:
    """Write into a lock who holds it."""
    signature = {"command": command, "process": os.getpid(), "host": socket.gethostname()}
    signature["since"] = time.strftime("%Y-%m-%d %H:%M:%S")
    try:
        os.ftruncate(lock, 0)
        os.write(lock, json.dumps(signature).encode())
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.EBADF):  # another user was killed and left it
            raise


def _signature(file: Path) -> dict[str, Any]:
    """Return who holds a lock; empty where it does not say so."""
    for _ in range(10):  # its holder may have just taken it
        with suppress(OSError, ValueError, TypeError):
            return dict(json.loads(file.read_text()))
        time.sleep(0.02)
    return {}


def _holder(file: Path) -> str:
    by = _signature(file)
    if not {"command", "process", "host", "since"} <= by.keys():
        return f"another process, which holds {file}"
    return f"{by['command']}, process {by['process']} on {by['host']} since {by['since']}"


def _lives(file: Path) -> bool:
    """Return whether the last holder of a lock is a process of this machine; warn that others cannot be seen."""
    _log.warning("%s: the file system has no locks; see to it that no other machine writes there", file.parent)
    by = _signature(file) if file.stat().st_size else {}
    return by.get("host") == socket.gethostname() and Path(f"/proc/{by.get('process')}").exists()
