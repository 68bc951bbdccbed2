"""A room from whatever file of s2a holds one."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from s2a import scan
from s2a.scene.scene import Scene
from s2a.scene.usd import descriptive, geometric, sim_stage
from s2a.scene.usd.descriptive import DescribedPart
from s2a.scene.usd.sim_scene import SimRoom
from s2a.scene.usd.stage import open_stage, read_attribute, reading

Content = Scene | SimRoom | dict[str, DescribedPart]
READERS: dict[str, Callable[[Path], Content]] = {
    descriptive.FLAVOUR: descriptive.read,
    geometric.FLAVOUR: geometric.read,
    sim_stage.FLAVOUR: sim_stage.read,
}


def read(path: Path) -> Content | None:
    """Read a scan's folder, or a descriptive, geometric or simulation-ready stage; None for a stage of another flavour.

    Raises:
        InputError: no such file, or a damaged one.
    """
    if path.is_dir():
        return scan.read(path)
    with reading(path):
        stage = open_stage(path, payloads=False)  # held, since its prims end with it
        reader = READERS.get(read_attribute(stage.GetDefaultPrim(), "flavour", str) or "")
        return reader(path) if reader else None
