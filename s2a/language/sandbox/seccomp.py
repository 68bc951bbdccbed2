"""A filter in the kernel that leaves a process the few system calls that editing a file in memory takes.

No new process or thread, no socket, no signal to another process, no memory that becomes code: whatever is not listed
fails with "Operation not permitted". Changes of permissions do nothing, for Landlock does not govern them.
"""

from __future__ import annotations

import ctypes
import platform
import struct

PR_SET_NO_NEW_PRIVS, PR_SET_SECCOMP, SECCOMP_MODE_FILTER = 38, 22, 2
ALLOW, REFUSE, IGNORE, KILL = 0x7FFF0000, 0x00050000 | 1, 0x00050000, 0x80000000
"""What a filter answers (linux/seccomp.h): go on; fail with EPERM; do nothing and succeed; end the process."""
LOAD, EQUAL, AT_LEAST, ANY_BIT, RETURN = 0x20, 0x15, 0x35, 0x45, 0x06
"""Instructions of classic BPF: load a word, three conditional jumps, return."""
NUMBER, ARCHITECTURE, SECOND, THIRD = 0, 4, 24, 32
"""Offsets in struct seccomp_data: the call's number, the architecture, the low words of two arguments."""
PROT_EXEC = 4
FCNTL = (0, 1, 2, 3, 1030)
"""fcntl commands that duplicate a descriptor or tell its flags; others send signals (F_SETOWN) or resize pipes."""

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
IGNORED = ("chmod", "fchmod", "fchmodat")
"""USD sets the permissions of what it saves, and only asks whether that failed."""
MACHINES = {"x86_64": (0xC000003E, X86_64), "aarch64": (0xC00000B7, AARCH64)}
"""Architecture tokens (linux/audit.h) and the numbers of the calls that are let through (asm/unistd.h)."""


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
