"""Input and result of an insertion: object and hint, room, model and logs; the object in its place."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from pxr import Sdf

from s2a.language.insert.describe import RoomState
from s2a.language.insert.object_file import ObjectConfig
from s2a.language.insert.place.candidate_poses import CandidatePose
from s2a.language.insert.place.contact import PoseConfig
from s2a.language.insert.place.supports import SurfaceConfig
from s2a.language.insert.placement import Placement
from s2a.language.insert.plan import Plan
from s2a.language.llm.ask import Model, Record, UsageLog
from s2a.language.sandbox.jail import SandboxConfig
from s2a.scene.scene import Mesh, Part, Scene

StabilityCheck = Callable[[Mesh, CandidatePose, Scene], Record]
"""(upright object, candidate pose, room) -> results with the key `problem`, empty if the object stays."""


@dataclass(frozen=True)
class InsertConfig:
    """Settings of an insertion.

    Attributes:
        surface: detection of support surfaces.
        pose: search for poses.
        object: reading of object files.
        sandbox: limits of scripts.
        retries: answers of the model that may be rejected, per step.
        plans: number of plans that are requested while there is no room for the earlier ones.
        neighbours: objects near the place that are described to the model when it estimates the size.
        wish: "heed" refuses a place that does not meet the wish; "prefer" takes it where there is none that does.
        script: "plan" writes the script from the plan; "model" asks the model for it, as the paper does.
        rules: True if no model reads the wish.
        trusted: Run scripts on systems that cannot confine them; for our own scripts.
    """

    surface: SurfaceConfig
    pose: PoseConfig
    object: ObjectConfig
    sandbox: SandboxConfig
    retries: int
    plans: int
    neighbours: int
    wish: Literal["heed", "prefer"]
    script: Literal["plan", "model"]
    rules: bool
    trusted: bool


@dataclass(frozen=True)
class ObjectRequest:
    """An object to insert.

    Attributes:
        file: a mesh or a USD stage.
        label: name of the object in any words.
        hint: placement hint in words, such as "next to the keyboard", or empty.
    """

    file: Path
    label: str
    hint: str = ""


@dataclass(frozen=True)
class Inserted:
    """An object in its place.

    Attributes:
        placement: id, reference and pose.
        candidate: the candidate pose that was accepted.
        part: the object as a part of the room, scene coordinates.
        mesh: its surface upright, in the unit of its file, as its own USD file holds it.
        layer: USD layer that the script made.
        plan: the plan by which it was placed.
    """

    placement: Placement
    candidate: CandidatePose
    part: Part
    mesh: Mesh
    layer: Sdf.Layer
    plan: Plan


@dataclass(frozen=True)
class InsertContext:
    """Inputs and logs of one insertion, passed through its steps.

    Attributes:
        room: the room; not changed.
        model: language model, recording or rules.
        config: settings.
        check_stability: drop test at a candidate pose.
        usage: log of the model's answers, appended to.
        record: results by step, filled also if a step fails.
    """

    room: RoomState
    model: Model
    config: InsertConfig
    check_stability: StabilityCheck
    usage: UsageLog
    record: Record
