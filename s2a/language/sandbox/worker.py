"""The process in which a script runs: it imports USD, enables its sandbox layers, and only then reads the script.

`s2a.language.sandbox.jail` starts it. The saved stage goes to a descriptor of its own, and what the script prints to
/dev/null. Reports after the script began are untrusted; the report of the active layers is sent before.
"""

import ctypes
import json
import os
import platform
import resource
import struct
import sys
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

CLONE_NEWNS, CLONE_NEWUTS, CLONE_NEWIPC, CLONE_NEWUSER, CLONE_NEWNET = (
    0x20000,
    0x4000000,
    0x8000000,
    0x10000000,
    0x40000000,
)
MS_NOSUID, MS_NODEV, MS_NOEXEC, MS_REC, MS_PRIVATE = 2, 4, 8, 0x4000, 0x40000
CAPABILITY_VERSION = 0x20080522
LANDLOCK_CREATE, LANDLOCK_ADD, LANDLOCK_RESTRICT = 444, 445, 446  # System calls, the same numbers on every machine
# Number of kinds of file access that a version of Landlock knows; later ones know no more
ACCESS_BITS = {1: 13, 2: 14, 3: 15, 4: 15, 5: 16}
# What the scratch folder grants: write, read, list, remove and make regular files, truncate
USABLE = 1 << 1 | 1 << 2 | 1 << 3 | 1 << 5 | 1 << 8 | 1 << 14
MEBIBYTE = 1 << 20
INODES = 64  # Files and folders in a scratch folder

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


PR_SET_NO_NEW_PRIVS, PR_SET_SECCOMP, SECCOMP_MODE_FILTER = 38, 22, 2
# What a filter answers (linux/seccomp.h): go on; fail with EPERM; do nothing and succeed; end the process
ALLOW, REFUSE, IGNORE, KILL = 0x7FFF0000, 0x00050000 | 1, 0x00050000, 0x80000000
# Instructions of classic BPF: load a word, three conditional jumps, return
LOAD, EQUAL, AT_LEAST, ANY_BIT, RETURN = 0x20, 0x15, 0x35, 0x45, 0x06
# Offsets in struct seccomp_data: the call's number, the architecture, the low words of two arguments
NUMBER, ARCHITECTURE, SECOND, THIRD = 0, 4, 24, 32
PROT_EXEC = 4
# fcntl commands that duplicate a descriptor or tell its flags; others send signals (F_SETOWN) or resize pipes
FCNTL = (0, 1, 2, 3, 1030)

X86_64 = {
    "read": 0, "write": 1, "open": 2, "close": 3, "stat": 4, "fstat": 5, "lstat": 6, "lseek": 8, "mmap": 9, "mprotect": 10,
    "munmap": 11, "brk": 12, "rt_sigaction": 13, "rt_sigprocmask": 14, "rt_sigreturn": 15, "pread64": 17, "pwrite64": 18,
    "readv": 19, "writev": 20, "access": 21, "sched_yield": 24, "mremap": 25, "madvise": 28, "dup": 32, "nanosleep": 35,
    "getpid": 39, "exit": 60, "uname": 63, "fcntl": 72, "fsync": 74, "fdatasync": 75, "ftruncate": 77, "getcwd": 79,
    "rename": 82, "unlink": 87, "readlink": 89, "chmod": 90, "fchmod": 91, "umask": 95, "gettimeofday": 96, "getrusage": 98,
    "sysinfo": 99, "times": 100, "getuid": 102, "getgid": 104, "geteuid": 107, "getegid": 108, "sigaltstack": 131,
    "statfs": 137, "fstatfs": 138, "gettid": 186, "futex": 202, "sched_getaffinity": 204, "getdents64": 217,
    "restart_syscall": 219, "clock_gettime": 228, "clock_getres": 229, "clock_nanosleep": 230, "exit_group": 231,
    "openat": 257, "newfstatat": 262, "unlinkat": 263, "renameat": 264, "readlinkat": 267, "fchmodat": 268,
    "faccessat": 269, "renameat2": 316, "getrandom": 318, "statx": 332, "rseq": 334, "faccessat2": 439,
}  # fmt: skip
AARCH64 = {
    "getcwd": 17, "dup": 23, "fcntl": 25, "unlinkat": 35, "renameat": 38, "statfs": 43, "fstatfs": 44, "ftruncate": 46,
    "faccessat": 48, "fchmod": 52, "fchmodat": 53, "openat": 56, "close": 57, "getdents64": 61, "lseek": 62, "read": 63,
    "write": 64, "readv": 65, "writev": 66, "pread64": 67, "pwrite64": 68, "readlinkat": 78, "newfstatat": 79, "fstat": 80,
    "fsync": 82, "fdatasync": 83, "exit": 93, "exit_group": 94, "futex": 98, "nanosleep": 101, "clock_gettime": 113,
    "clock_getres": 114, "clock_nanosleep": 115, "sched_getaffinity": 123, "sched_yield": 124, "restart_syscall": 128,
    "sigaltstack": 132, "rt_sigaction": 134, "rt_sigprocmask": 135, "rt_sigreturn": 139, "times": 153, "uname": 160,
    "getrusage": 165, "umask": 166, "gettimeofday": 169, "getpid": 172, "getuid": 174, "geteuid": 175, "getgid": 176,
    "getegid": 177, "gettid": 178, "sysinfo": 179, "brk": 214, "munmap": 215, "mremap": 216, "mmap": 222, "mprotect": 226,
    "madvise": 233, "renameat2": 276, "getrandom": 278, "statx": 291, "rseq": 293, "faccessat2": 439,
}  # fmt: skip
# USD sets the permissions of what it saves, and only asks whether that failed
IGNORED = ("chmod", "fchmod", "fchmodat")
# Architecture tokens (linux/audit.h) and the numbers of the calls that are let through (asm/unistd.h)
MACHINES = {"x86_64": (0xC000003E, X86_64), "aarch64": (0xC00000B7, AARCH64)}


class _Program(ctypes.Structure):
    """struct sock_fprog."""

    _fields_ = [("length", ctypes.c_ushort), ("instructions", ctypes.c_char_p)]


def install() -> None:
    """Put the filter on this process, for good.

    Raises:
        OSError: the kernel has no seccomp, or this kind of machine has no table here.
    """
    if platform.machine() not in MACHINES:
        raise OSError(f"no table of system calls for {platform.machine()}")
    code = b"".join(_filter(*MACHINES[platform.machine()]))
    program = _Program(len(code) // 8, code)
    libc = ctypes.CDLL(None, use_errno=True)
    for arguments in ((PR_SET_NO_NEW_PRIVS, 1, 0), (PR_SET_SECCOMP, SECCOMP_MODE_FILTER, ctypes.byref(program))):
        if libc.prctl(*arguments, 0, 0):
            raise OSError(ctypes.get_errno(), "prctl")


def _filter(token: int, calls: dict[str, int]) -> list[bytes]:
    """Return the filter's instructions: the machine first, then calls with an argument to look at, then the list."""
    program = [_step(LOAD, ARCHITECTURE), _step(EQUAL, token, 1, 0), _step(RETURN, KILL)]
    program += [_step(LOAD, NUMBER), _step(AT_LEAST, 0x40000000, 0, 1), _step(RETURN, REFUSE)]  # x32: other numbers
    for name in ("mmap", "mprotect"):
        body = [_step(LOAD, THIRD), _step(ANY_BIT, PROT_EXEC, 0, 1), _step(RETURN, REFUSE), _step(RETURN, ALLOW)]
        program += [_step(EQUAL, calls[name], 0, len(body)), *body]
    body = [_step(LOAD, SECOND)]
    for command in FCNTL:
        body += [_step(EQUAL, command, 0, 1), _step(RETURN, ALLOW)]
    program += [_step(EQUAL, calls["fcntl"], 0, len(body) + 1), *body, _step(RETURN, REFUSE)]
    for name, number in sorted(calls.items(), key=lambda call: call[1]):
        program += [_step(EQUAL, number, 0, 1), _step(RETURN, IGNORE if name in IGNORED else ALLOW)]
    return [*program, _step(RETURN, REFUSE)]


def _step(code: int, value: int, if_true: int = 0, if_false: int = 0) -> bytes:
    """Return one instruction: struct sock_filter."""
    return struct.pack("<HBBI", code, if_true, if_false, value)


NAME = "<script>"  # What tracebacks call the script
# What each sandbox layer keeps a script from
GUARANTEES = {"namespaces": ("files", "network"), "landlock": ("files",), "seccomp": ("network", "processes")}


def main(descriptor: int) -> None:
    """Enable the layers of the job that a descriptor holds; run the script on standard input, and hand over the saved stage.

    What holds, and what went wrong, is reported to a descriptor that the job names; the stage goes to another.
    """
    job = read_job(descriptor)
    active = enable_layers(job, preload)
    tell(job["report"], {"active": active})
    task = json.load(sys.stdin)
    error = execute(task["script"], task["names"])
    tell(job["report"], error)
    if not error:
        os.write(job["result"], Path(job["stage"]).read_bytes())
    os._exit(0)  # without the clean-up of what the script made


def read_job(descriptor: int) -> dict[str, Any]:
    """Return the job that a descriptor holds."""
    with open(descriptor) as file:
        job: dict[str, Any] = json.load(file)
    return job


def enable_layers(job: dict[str, Any], preload: Callable[[], None]) -> list[str]:
    """Enter the scratch folder, write the stage there, preload, and enable the sandbox layers; return the active ones."""
    active: list[str] = []
    wanted = job["layers"]
    if "namespaces" in wanted and _enabled(lambda: enter_namespaces(Path(job["scratch"]), job["disk"])):
        active.append("namespaces")
    here = Path(job["scratch"], "here")  # not the root itself: USD writes no file into a folder without a name
    here.mkdir()
    os.chdir(here)
    Path(job["stage"]).write_text(job["stage_text"])
    preload()
    os.dup2(1, 2)  # errors until here are reported; what a script prints is dropped
    limit(job["cpu_seconds"], job["memory"], job["disk"])
    if active and not _enabled(drop_privileges):
        active.clear()
    if "landlock" in wanted and _enabled(landlock):
        active.append("landlock")
    if "seccomp" in wanted and _enabled(install):
        active.append("seccomp")
    return active


def execute(script: str, names: dict[str, str]) -> dict[str, Any]:
    """Run a script as a main program; return what went wrong, or nothing."""
    try:
        exec(compile(script, NAME, "exec"), {"__name__": "__main__", **names})
    except BaseException as error:  # also SystemExit: whatever a script raises is its failure
        lines = [line for frame, line in traceback.walk_tb(error.__traceback__) if frame.f_code.co_filename == NAME]
        line = lines[-1] if lines else getattr(error, "lineno", None)
        return {"line": line, "reason": f"{type(error).__name__}: {error}"[:1000]}
    return {}


def preload() -> None:
    """Import and use once what a script may import: later loads would be denied their files."""
    os.environ["PXR_WORK_THREAD_LIMIT"] = "1"
    import __future__  # noqa: F401

    import math  # noqa: F401
    import unicodedata  # noqa: F401  (Python's parser asks for it when a name is not ASCII)

    from pxr import Gf, Kind, Sdf, Tf, Usd, UsdGeom, UsdSemantics, Vt  # noqa: F401

    stage = Usd.Stage.CreateInMemory()
    prim = UsdGeom.Xform.Define(stage, "/rehearsal").GetPrim()
    UsdGeom.Xformable(prim).AddTranslateOp().Set(Gf.Vec3d(0.0))
    UsdSemantics.LabelsAPI.Apply(prim, "class")
    Usd.ModelAPI(prim).SetKind(Kind.Tokens.component)
    stage.GetRootLayer().Export("rehearsal.usda")
    Usd.Stage.Open("rehearsal.usda").Save()
    os.unlink("rehearsal.usda")


def _enabled(layer: Callable[[], None]) -> bool:
    """Enable a layer; False where the system does not offer it."""
    try:
        layer()
    except OSError:
        return False
    return True


def tell(report: int, message: dict[str, Any]) -> None:
    """Write one line of JSON."""
    os.write(report, json.dumps(message).encode() + b"\n")
