"""A stage with a wall, a mug that a script is to place in it, and limits for that script."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from hostile_scripts import GOOD
from settings import load

from s2a.language.insert.batch import geometry_free_text, write_object
from s2a.language.sandbox.diff import Placement
from s2a.language.sandbox.jail import Sandbox, SandboxConfig
from s2a.scene.scene import Mesh, Part, Scene
from s2a.scene.usd import geometric

CONFIG = replace(load(SandboxConfig, "insert/sandbox"), cpu_seconds=0.5)
QUARTER = (0.0, 0.0, 0.7071067811865476, 0.7071067811865476)
PLAN = Placement("mug_8", "coffee mug", "objects/mug.usd", (1.5, -0.25, 0.75), QUARTER, 0.5)
UPRIGHT = replace(PLAN, orientation=(0.0, 0.0, 0.0, 1.0), scale=1.0)
"""What `hostile_scripts.GOOD` places."""


def square() -> Mesh:
    return Mesh(np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), np.array([[0, 1, 2], [0, 2, 3]]))


def write_stage(folder: Path) -> Path:
    """Write a stage with a wall, and an object beside it."""
    geometric.write(Scene("room", {"wall_1": Part("wall", square(), None, "fixed")}), folder / "geometric.usd")
    (folder / "objects").mkdir()
    write_object(square(), folder / "objects/mug.usd")
    return folder / "geometric.usd"


def saved(stage: Path) -> bytes:
    """Return the stage as `GOOD` saves it."""
    with Sandbox(geometry_free_text(stage), CONFIG, False) as sandbox:
        return sandbox.run(GOOD, {}).saved
