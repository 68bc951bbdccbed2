"""Outputs: locked against a second command, written to a temporary sibling, then renamed."""

import errno
import fcntl
import glob
import os
import shutil
import stat
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, get_args, get_type_hints

from s2a.core import locks
from s2a.core.errors import CheckFailed, InputError
from s2a.core.locks import MARK, REFUSED, contents, start_of

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)  # What a full disk answers
# The same of libraries that drop its number; the first are NumPy's
FULL_WORDS = ("requested and", "No space left on device", "Disk quota exceeded", "File too large")
SCARCE = 65536  # [byte] A disk with less is taken for full where a library fails: each writes more at a time than this
ATTEMPTS = 50
PART = ".part"  # Ending of a file that is being written by `replace_file`


@dataclass(frozen=True)
class Written:
    """Annotation of a field that names what a command writes."""


Output = Annotated[Path, Written()]  # The type of a key that names a file or a folder which the command writes


def keys(settings: type) -> list[str]:
    """Return the keys of a command's settings that name outputs."""
    hints = get_type_hints(settings, include_extras=True)
    return [key for key, hint in hints.items() if any(Written() in get_args(kind) for kind in (hint, *get_args(hint)))]


@contextmanager
def locked(outputs: Mapping[str, Path], command: str) -> Iterator[None]:
    """Keep other commands from the outputs of this one while the block runs.

    `outputs` are paths by key.

    Raises:
        InputError: another command holds one of them, or one cannot be written.
    """
    places = {os.path.realpath(path): (key, path) for key, path in outputs.items()}  # two keys may name one folder
    with ExitStack() as stack:
        for name, (key, path) in sorted(places.items()):  # in one order, or two commands could refuse each other
            place = Path(name)
            with unwritable_reported(path):
                stack.callback(_remove_empty, _make_parents(place))
                stack.enter_context(locks.held(place, f"{key} {str(path)!r}", command))
        yield


def _remove_empty(folders: Iterable[Path]) -> None:
    for folder in folders:
        with suppress(OSError):  # somebody else's file is in it
            folder.rmdir()


def refuse_loss(path: Path, earlier: str, read: Iterable[Path]) -> None:
    """Raise an InputError if writing a folder would delete foreign files, or inputs that are still needed.

    `earlier`: a file in it by which an earlier output is known, which may be replaced.
    """
    _refuse_foreign(path, earlier)
    for file in read:
        if Path(os.path.realpath(path)) in Path(os.path.realpath(file)).parents:
            raise InputError(f"out {str(path)!r} would be replaced with {str(file)!r} in it; choose another path")


@contextmanager
def full_disk_reported(path: Path) -> Iterator[None]:
    """Raise an InputError that names an output where the block fails because the disk is full; other errors as they are."""
    try:
        yield
    except (InputError, CheckFailed):
        raise
    except Exception as error:
        number = getattr(error, "errno", None)
        is_hidden = any(words in str(error) for words in FULL_WORDS) or (number is None and _is_full(path))
        if number not in FULL and not is_hidden:
            raise
        reason = os.strerror(number if number in FULL else errno.ENOSPC)
        raise InputError(f"{path}: cannot be written: {reason}; free some space, or choose another path") from error


@contextmanager
def unwritable_reported(path: Path, remedy: str = "choose another path") -> Iterator[None]:
    """Raise an InputError that names an output and what to do where the block cannot make a file beside it."""
    try:
        with full_disk_reported(path):
            yield
    except OSError as error:
        if error.errno not in REFUSED:
            raise
        raise InputError(f"{path}: cannot be written: {error.strerror}; {remedy}") from error


def require_writable(path: Path, remedy: str) -> None:
    """Raise an InputError with what to do unless `atomic_write` can write a path."""
    with unwritable_reported(path, remedy), temporary_folder(path):
        pass


def _is_full(path: Path) -> bool:
    """Return whether the disk of a path has no space left: libraries hide what the system answered."""
    try:
        state = os.statvfs(next(folder for folder in path.absolute().parents if folder.exists()))
    except OSError:
        return False
    return state.f_bavail * state.f_frsize < SCARCE or 0 == state.f_favail < state.f_files


@contextmanager
def atomic_write(path: Path, earlier: str | None = None) -> Iterator[Path]:
    """Yield a temporary path of the same name; when the block succeeds, rename it to `path`.

    When it fails, the temporary path is deleted and an earlier output at `path` stays unchanged.

    `earlier`: where `path` is a folder, a file in it by which an earlier output is known, which may be replaced.

    Raises:
        InputError: a file is to be written where a folder is, or a folder where a file is, or one that is neither empty nor an
            earlier output; one from the block names `path`.
    """
    _refuse_foreign(path, earlier)
    with unwritable_reported(path):
        made = _make_parents(path)
    try:
        with full_disk_reported(path):
            yield from _replacing(path)
        made = []
    finally:
        _remove_empty(made)


def _replacing(path: Path) -> Iterator[Path]:
    with unwritable_reported(path):
        room, lock = _new_folder(path)
    try:
        try:
            with full_disk_reported(path):  # here, while what fills the disk is there
                yield room / path.name
        except InputError as error:
            raise InputError(str(error).replace(str(room / path.name), str(path))) from error
        _swap(room, path)
    finally:
        _delete(room, lock)


def replace_file(path: Path, write: Callable[[Path], object]) -> None:
    """Write a file under another name first, ending in PART, so that it is there whole or not at all.

    For one of many in a folder of ours: unlike `atomic_write` it neither looks for what others left nor keeps them out.
    """
    with unwritable_reported(path):
        path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(path.name + PART)
    try:
        with full_disk_reported(path):
            write(part)
            os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


@contextmanager
def temporary_folder(beside: Path | None = None) -> Iterator[Path]:
    """Yield a new folder, and delete it afterwards; delete those that killed processes have left there, too.

    `beside`: the folder is made beside this path; None: in the system's folder for temporary files.
    """
    room, lock = _new_folder(beside or Path(tempfile.gettempdir(), "s2a"))
    try:
        yield room
    finally:
        _delete(room, lock)


def _new_folder(beside: Path) -> tuple[Path, int]:
    _remove_leftovers(beside)
    return _locked_folder(beside)


def _delete(room: Path, lock: int) -> None:
    shutil.rmtree(room)
    os.close(lock)


def require_png(path: Path) -> None:
    """Raise an InputError unless the file that the key `image` names ends in .png."""
    if path.suffix.lower() != ".png":
        raise InputError(f"key 'image' is {str(path)!r}; expected a PNG file: give image=FILE.png")


def _locked_folder(path: Path) -> tuple[Path, int]:
    """Make a folder beside `path`; return it, and a descriptor that keeps it locked for as long as this process lives."""
    new = tempfile.mkdtemp(prefix=f".{MARK}", dir=path.parent)
    lock = os.open(new, os.O_RDONLY)
    with suppress(OSError):  # file systems without locks
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    room = path.parent / f".{start_of(path)}.{MARK}{new[-8:]}"
    os.rename(new, room)
    return room, lock


def _remove_leftovers(path: Path) -> None:
    """Remove what processes that were killed have left beside `path`: folders of ours that nobody has locked."""
    for folder in path.parent.glob(f".{glob.escape(start_of(path))}.{MARK}????????"):
        with suppress(OSError):
            lock = os.open(folder, os.O_RDONLY)
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                shutil.rmtree(folder, ignore_errors=True)
            finally:
                os.close(lock)


def _refuse_foreign(path: Path, earlier: str | None) -> None:
    """Raise if `path` is of the other kind, or replacing it would delete files that are not ours."""
    remedy = "choose another path or delete it yourself"
    whole, here = Path(os.path.realpath(path)), Path(os.path.realpath(os.curdir))
    if whole == here or whole in here.parents:
        raise InputError(f"out {str(path)!r} is the current folder, or one above it; name a file or a folder in it")
    try:
        is_folder = stat.S_ISDIR(path.stat().st_mode)  # asked once: another process may be replacing it
    except OSError:  # not there, or a loop of links
        return
    if not is_folder and not path.is_file():
        raise InputError(f"out {str(path)!r} is a device; give the path of a file")
    if earlier is None and is_folder:
        raise InputError(f"out {str(path)!r} is a folder where a file should be written; {remedy}")
    if earlier is not None and not is_folder:
        raise InputError(f"out {str(path)!r} is a file where a folder should be written; {remedy}")
    if earlier is not None and (holder := locks.holder_within(path)):
        raise InputError(f"out {str(path)!r} has an output in it that {holder} writes; wait, or choose another path")
    if earlier is not None and all(_holds_others(path, earlier) for _ in range(3)):
        raise InputError(f"out {str(path)!r} is not empty and has no {earlier} as an earlier output would; {remedy}")


def _holds_others(path: Path, earlier: str) -> bool:
    """Return True for a folder with files, but no earlier output; also for a moment while one is being replaced."""
    try:
        if not contents(path) or (path / earlier).exists():
            return False
    except FileNotFoundError:
        return False
    time.sleep(0.02)
    return True


def _make_parents(path: Path) -> list[Path]:
    """Make the folder that `path` lies in; return what had to be made, deepest first."""
    made = [folder for folder in path.parents if not folder.exists()]
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError) as error:
        raise InputError(f"out {str(path)!r} lies below something that is not a folder: {error.filename!r}") from error
    return made


def _swap(room: Path, path: Path) -> None:
    """Put room/<name> where `path` was; an earlier folder steps into the room, and comes back if that fails.

    Of several that write the same folder at once, each finds another's from time to time, and tries again.
    """
    for left in reversed(range(ATTEMPTS)):
        try:
            if not path.is_dir():
                os.replace(room / path.name, path)
            else:
                _swap_folder(room, path)
            return
        except OSError as error:
            if not left or error.errno not in (errno.ENOENT, errno.ENOTEMPTY, errno.EEXIST):
                raise
            time.sleep(0.01)


def _swap_folder(room: Path, path: Path) -> None:
    old = room / "earlier"
    if old.exists():
        shutil.rmtree(old)
    os.replace(path, old)
    try:
        os.replace(room / path.name, path)
    except BaseException:
        if not path.exists():
            os.replace(old, path)
        raise
