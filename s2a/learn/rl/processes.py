"""Several processes that train one policy together, as torchrun starts them: each has worlds of its own."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TypeVar

import torch

from s2a.core.errors import InputError

Item = TypeVar("Item")


def rank() -> int:
    """Return which of the processes this is; 0, the only one where torchrun was not used, writes all files."""
    return int(os.environ.get("RANK", "0"))


def count() -> int:
    """Return how many processes there are."""
    return int(os.environ.get("WORLD_SIZE", "1"))


def own_device(device: str) -> str:
    """Return the device of this process for the user's key `device`.

    Raises:
        InputError: there are several processes, and the key gives all the same GPU.
    """
    if count() == 1 or device == "cpu":
        return device
    own = f"cuda:{os.environ.get('LOCAL_RANK', '0')}" if torch.cuda.is_available() else "cpu"
    if device not in ("auto", own):
        raise InputError(f"key 'device' is {device!r}; under torchrun every process takes its own: give auto or cpu")
    return own


def own_seed(seed: int, iteration: int = 0) -> int:
    """Return a seed for this process: `seed` itself for the first process of a run that begins at iteration 0.

    A run that goes on at another iteration would otherwise draw the noise of its beginning again.
    """
    return seed + 1_000_003 * rank() + 7_919 * iteration


def own_items(items: Sequence[Item]) -> list[Item]:
    """Return every n-th of some items for n processes, so that each is one process's; all where there are fewer than n."""
    return list(items[rank() :: count()]) if len(items) >= count() else list(items)


def add_up(total: torch.Tensor) -> torch.Tensor:
    """Return the sum of a tensor over all processes; each has to call this."""
    if torch.distributed.is_initialized():
        torch.distributed.all_reduce(total)
    return total


def part() -> None:
    """End the processes' connection, if there is one."""
    if torch.distributed.is_initialized():
        torch.distributed.destroy_process_group()
