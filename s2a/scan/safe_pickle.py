"""Pickles of strangers, read without running any of their code: arrays, numbers, strings, lists and dictionaries alone."""

from __future__ import annotations

import pickle
import reprlib
from pathlib import Path
from typing import Any

import numpy as np

from s2a.errors import InputError

_ARRAYS = ("numpy.core.multiarray", "numpy._core.multiarray")
_NUMERIC = ("numpy.core.numeric", "numpy._core.numeric")
_ALLOWED = {(module, name) for module in _ARRAYS for name in ("_reconstruct", "scalar")}
_ALLOWED |= {(module, "_frombuffer") for module in _NUMERIC}
_BYTES = ("_codecs", "encode")  # as protocols below 3 write bytes
_ALLOWED |= {_BYTES, ("numpy", "ndarray"), ("numpy", "dtype"), ("collections", "OrderedDict")}


def read(path: Path) -> Any:
    """Return what a pickle file holds.

    Raises:
        InputError: it cannot be read, is damaged, or needs anything but arrays, numbers, strings, lists and dictionaries.
    """
    try:
        with path.open("rb") as file:
            return _Restricted(file).load()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check the path and its permissions") from error
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    except (
        Exception
    ) as error:  # a damaged pickle provokes any: EOFError, KeyError, ValueError, AttributeError, MemoryError ...
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:120]
        raise InputError(f"{path}: truncated or not a pickle ({reason}); save it again") from error


class _Restricted(pickle.Unpickler):
    """An unpickler that finds numpy's constructors and nothing else."""

    def find_class(self, module: str, name: str) -> Any:
        """Return an allowed constructor."""
        if (module, name) not in _ALLOWED:
            raise InputError(
                f"the pickle asks for {reprlib.repr(module + '.' + name)}, which may run code; "
                "save numpy arrays in dictionaries (tensor.cpu().numpy()), or JSON"
            )
        # Pickles name the modules of the numpy that wrote them; both names have been the same functions.
        if (module, name) == _BYTES:
            return _latin
        if (module, name) == ("numpy", "dtype"):
            return _plain_dtype
        return super().find_class(module.replace("numpy.core", "numpy._core"), name)


def _latin(text: str, encoding: str) -> bytes:
    """Return bytes that a pickle holds as text."""
    if encoding != "latin1":
        raise InputError(f"the pickle holds bytes as {encoding!r}; save it with protocol 4, or JSON")
    return text.encode("latin1")


def _plain_dtype(*arguments: Any) -> np.dtype[Any]:
    """Return a type of numbers or strings; arrays of objects hold anything."""
    kind = np.dtype(*arguments)
    if kind.hasobject:
        raise InputError("the pickle holds an array of objects; save arrays of numbers, or JSON")
    return kind
