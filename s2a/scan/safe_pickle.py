"""Pickles of strangers, read without running any of their code: arrays, numbers, strings, lists and dictionaries alone."""

from __future__ import annotations

import pickle
import reprlib
from collections import OrderedDict
from pathlib import Path
from typing import Any

import numpy as np

from s2a.core.errors import InputError


def read(path: Path) -> Any:
    """Return what a pickle file holds.

    Raises:
        InputError: it cannot be read, is damaged, or needs anything but arrays, numbers, strings, lists and dictionaries.
    """
    try:
        with path.open("rb") as file:
            return _resolved(_Restricted(file).load())
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check the path and its permissions") from error
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    except Exception as error:  # damage provokes any: EOFError, KeyError, ValueError, AttributeError, MemoryError ...
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:120]
        raise InputError(f"{path}: truncated or not a pickle ({reason}); save it again") from error


class _Restricted(pickle.Unpickler):
    """An unpickler that finds stand-ins of numpy's constructors and nothing else."""

    def find_class(self, module: str, name: str) -> Any:
        """Return what stands for an allowed constructor."""
        found = _STAND_INS.get((module.replace("numpy.core", "numpy._core"), name))
        if found is None:
            raise InputError(
                f"the pickle asks for {reprlib.repr(module + '.' + name)}, which may run code; "
                "save numpy arrays in dictionaries (tensor.cpu().numpy()), or JSON"
            )
        return found


class _Dtype:
    """A type of numbers or strings. numpy's own takes flags from a pickle by which it reads numbers as addresses of objects."""

    def __init__(self, code: str, align: bool = False, copy: bool = False) -> None:
        self.plain = np.dtype(code)
        if self.plain.hasobject:
            raise InputError("the pickle holds an array of objects; save arrays of numbers, or JSON")
        if self.plain.kind not in "biufcSU":
            raise InputError(f"the pickle holds an array of {self.plain}; save arrays of numbers, or JSON")

    def __setstate__(self, state: tuple[Any, ...]) -> None:
        """Take the byte order, which is all that a plain type has."""
        if state[1] in ("<", ">"):
            self.plain = self.plain.newbyteorder(state[1])


class _Array:
    """An array whose contents follow."""

    value: np.ndarray = np.zeros(0)

    def __setstate__(self, state: tuple[Any, ...]) -> None:
        _, shape, dtype, fortran, data = state
        self.value = _from_buffer(data, dtype, shape, "F" if fortran else "C").value


def _reconstruct(*_: Any) -> _Array:
    return _Array()


def _from_buffer(data: bytes, dtype: _Dtype, shape: tuple[int, ...], order: str) -> _Array:
    found = _Array()
    flat = np.frombuffer(data, dtype.plain) if data else np.zeros(0, dtype.plain)
    found.value = flat.reshape(shape, order="F" if order == "F" else "C").copy()
    return found


def _scalar(dtype: _Dtype, data: bytes) -> Any:
    return np.frombuffer(data, dtype.plain)[0]


def _latin(text: str, encoding: str) -> bytes:
    """Return bytes that a pickle of a protocol below 3 holds as text."""
    if encoding != "latin1":
        raise InputError(f"the pickle holds bytes as {encoding!r}; save it with protocol 4, or JSON")
    return text.encode("latin1")


def _resolved(value: Any) -> Any:
    """Return contents with arrays in the place of what stands for them."""
    if isinstance(value, _Array):
        return value.value
    if isinstance(value, dict):
        return {key: _resolved(each) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return type(value)(_resolved(each) for each in value)
    return value


_STAND_INS = {
    ("numpy._core.multiarray", "_reconstruct"): _reconstruct,
    ("numpy._core.multiarray", "scalar"): _scalar,
    ("numpy._core.numeric", "_frombuffer"): _from_buffer,
    ("numpy", "ndarray"): _Array,
    ("numpy", "dtype"): _Dtype,
    ("_codecs", "encode"): _latin,
    ("collections", "OrderedDict"): OrderedDict,
}
