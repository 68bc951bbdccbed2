"""Sandbox layers of Linux for an unprivileged process: limits, namespaces, Landlock.

Each layer raises an OSError where the system does not offer it. Constants are those of the kernel's headers.
"""

from __future__ import annotations

import ctypes
import os
import resource
import struct
from pathlib import Path

CLONE_NEWNS, CLONE_NEWUTS, CLONE_NEWIPC, CLONE_NEWUSER, CLONE_NEWNET = (
    0x20000,
    0x4000000,
    0x8000000,
    0x10000000,
    0x40000000,
)
MS_NOSUID, MS_NODEV, MS_NOEXEC, MS_REC, MS_PRIVATE = 2, 4, 8, 0x4000, 0x40000
CAPABILITY_VERSION = 0x20080522
LANDLOCK_CREATE, LANDLOCK_ADD, LANDLOCK_RESTRICT = 444, 445, 446
"""System calls, the same numbers on every machine."""
ACCESS_BITS = {1: 13, 2: 14, 3: 15, 4: 15, 5: 16}
"""Number of kinds of file access that a version of Landlock knows; later ones know no more."""
USABLE = 1 << 1 | 1 << 2 | 1 << 3 | 1 << 5 | 1 << 8 | 1 << 14
"""What the scratch folder grants: write, read, list, remove and make regular files, truncate."""
MEBIBYTE = 1 << 20
INODES = 64
"""Files and folders in a scratch folder."""

libc = ctypes.CDLL(None, use_errno=True)


def limit(cpu_seconds: float, memory: int, disk: int) -> None:
    """Bound what this process may still use; the kernel ends it, or the call fails.

    Args:
        cpu_seconds: of one core, from now on [s].
        memory: address space beyond what it has now [MiB].
        disk: size of a file [MiB].
    """
    spent = resource.getrusage(resource.RUSAGE_SELF)
    seconds = int(spent.ru_utime + spent.ru_stime + cpu_seconds) + 1
    size = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize() + memory * MEBIBYTE
    bounds = {
        "CPU": seconds,
        "AS": size,
        "FSIZE": disk * MEBIBYTE,
        "NOFILE": 32,
        "CORE": 0,
        "MEMLOCK": 0,
        "MSGQUEUE": 0,
    }
    for name, bound in bounds.items():
        resource.setrlimit(getattr(resource, f"RLIMIT_{name}"), (bound, bound))


def enter_namespaces(scratch: Path, disk: int) -> None:
    """Move this process into namespaces of its own: no network, and a scratch folder in memory that nobody else sees.

    Must be called while the process has one thread.

    Args:
        scratch: an empty folder; what is written there from now on vanishes with the process.
        disk: its size [MiB].
    """
    user, group = os.getuid(), os.getgid()
    _call("unshare", CLONE_NEWUSER | CLONE_NEWNS | CLONE_NEWNET | CLONE_NEWIPC | CLONE_NEWUTS)
    own = Path("/proc/self")
    (own / "setgroups").write_text("deny")
    (own / "uid_map").write_text(f"{user} {user} 1")
    (own / "gid_map").write_text(f"{group} {group} 1")
    _call("mount", None, b"/", None, ctypes.c_ulong(MS_REC | MS_PRIVATE), None)
    options = f"size={disk}m,nr_inodes={INODES},mode=700".encode()
    _call("mount", b"none", bytes(scratch), b"tmpfs", ctypes.c_ulong(MS_NOSUID | MS_NODEV | MS_NOEXEC), options)


def drop_privileges() -> None:
    """Make the folder above the current one all there is, and give up the right to change that; only after `enter_namespaces`."""
    _call("chroot", b"..")
    header, none = struct.pack("<Ii", CAPABILITY_VERSION, 0), bytes(24)
    _call("capset", header, none)


def landlock() -> None:
    """Deny this process all files but those below the current folder, TCP, and signals to other processes.

    Older kernels know files alone (version 4 brought TCP, 6 signals).
    """
    version = _system_call(LANDLOCK_CREATE, None, 0, 1)
    files = (1 << ACCESS_BITS.get(version, 16)) - 1
    fields = (files, 3 if version >= 4 else 0, 3 if version >= 6 else 0)
    rules = struct.pack(
        f"<{1 if version < 4 else 2 if version < 6 else 3}Q", *[f for i, f in enumerate(fields) if i == 0 or f]
    )
    ruleset = _system_call(LANDLOCK_CREATE, rules, len(rules), 0)
    folder = os.open(".", os.O_PATH | os.O_CLOEXEC)
    _system_call(LANDLOCK_ADD, ruleset, 1, struct.pack("<Qi", USABLE & files, folder), 0)
    _call("prctl", 38, 1, 0, 0, 0)  # no new privileges: what Landlock asks of a process without rights
    _system_call(LANDLOCK_RESTRICT, ruleset, 0)
    os.close(folder)
    os.close(ruleset)


def _call(name: str, *arguments: object) -> int:
    """Call a function of the C library."""
    result = getattr(libc, name)(*arguments)
    if result < 0:
        raise OSError(ctypes.get_errno(), f"{name}: {os.strerror(ctypes.get_errno())}")
    return result


def _system_call(number: int, *arguments: object) -> int:
    """Make a system call that the C library has no name for."""
    return _call("syscall", ctypes.c_long(number), *arguments)
