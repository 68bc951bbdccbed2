"""Atomic outputs: written to a temporary sibling, then renamed."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from s2a.errors import InputError


def refuse_loss(path: Path, earlier: str, read: Iterable[Path]) -> None:
    """Raise an InputError if writing a folder would delete foreign files, or inputs that are still needed.

    Args:
        path: the folder to write.
        earlier: a file in it by which an earlier output is known, which may be replaced.
        read: files that are still needed.
    """
    _refuse_foreign(path, earlier)
    for file in read:
        if path.resolve() in file.resolve().parents:
            raise InputError(f"out {str(path)!r} would be replaced with {str(file)!r} in it; choose another path")


@contextmanager
def atomic_write(path: Path, earlier: str | None = None) -> Iterator[Path]:
    """Yield a temporary path of the same name; when the block succeeds, rename it to `path`.

    When it fails, the temporary path is deleted and an earlier output at `path` stays unchanged.

    Args:
        path: the file or folder to write.
        earlier: where `path` is a folder, a file in it by which an earlier output is known, which may be replaced.

    Raises:
        InputError: a file is to be written where a folder is, or a folder where a file is, or one that is neither empty nor an
            earlier output; one from the block names `path`.
    """
    _refuse_foreign(path, earlier)
    made = _make_parents(path)
    room = Path(tempfile.mkdtemp(prefix=f".{path.name}.", dir=path.parent))
    try:
        yield room / path.name
        _swap(room, path)
        made = []
    except InputError as error:
        raise InputError(str(error).replace(str(room / path.name), str(path))) from error
    finally:
        shutil.rmtree(room)
        for folder in made:
            if not any(folder.iterdir()):
                folder.rmdir()


def require_png(path: Path) -> None:
    """Raise an InputError unless the file that the key `image` names ends in .png."""
    if path.suffix.lower() != ".png":
        raise InputError(f"key 'image' is {str(path)!r}; expected a PNG file: give image=FILE.png")


def _refuse_foreign(path: Path, earlier: str | None) -> None:
    """Raise if `path` is of the other kind, or replacing it would delete files that are not ours."""
    remedy = "choose another path or delete it yourself"
    if earlier is None and path.is_dir():
        raise InputError(f"out {str(path)!r} is a folder where a file should be written; {remedy}")
    if earlier is not None and path.exists() and not path.is_dir():
        raise InputError(f"out {str(path)!r} is a file where a folder should be written; {remedy}")
    if earlier is not None and path.is_dir() and any(path.iterdir()) and not (path / earlier).exists():
        raise InputError(f"out {str(path)!r} is not empty and has no {earlier} as an earlier output would; {remedy}")


def _make_parents(path: Path) -> list[Path]:
    """Make the folder that `path` lies in; return what had to be made, deepest first."""
    made = [folder for folder in path.parents if not folder.exists()]
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError) as error:
        raise InputError(f"out {str(path)!r} lies below something that is not a folder: {error.filename!r}") from error
    return made


def _swap(room: Path, path: Path) -> None:
    """Put room/<name> where `path` was; an earlier folder steps into the room, and comes back if that fails."""
    if not path.is_dir():
        os.replace(room / path.name, path)
        return
    old = room / "earlier"
    os.replace(path, old)
    try:
        os.replace(room / path.name, path)
    except BaseException:
        os.replace(old, path)
        raise
