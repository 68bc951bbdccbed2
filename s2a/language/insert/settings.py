"""Settings of an insertion, the keys of `s2a insert`; an object that is requested, and one in its place."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from pxr import Sdf

from s2a.core.bounds import Count, CountFromZero
from s2a.core.outputs import Output
from s2a.language.client import LlmConfig, kind_of
from s2a.language.insert.drop_test import DropTestConfig
from s2a.language.insert.object_file import ObjectConfig
from s2a.language.insert.plan import Plan
from s2a.language.insert.poses import CandidatePose, PoseConfig
from s2a.language.insert.stability import HullsConfig
from s2a.language.insert.supports import SurfaceConfig
from s2a.language.sandbox.diff import Placement
from s2a.language.sandbox.jail import SandboxConfig
from s2a.scene.geometry.camera import OrbitCamera
from s2a.scene.scene import Mesh, Part


@dataclass(frozen=True)
class ObjectRequest:
    """An object to insert."""

    file: Path  # a mesh or a USD stage
    label: str  # name of the object in any words
    hint: str = ""  # placement hint in words, such as "next to the keyboard", or empty


@dataclass(frozen=True)
class Inserted:
    """An object in its place."""

    placement: Placement  # id, reference and pose
    candidate: CandidatePose  # the candidate pose that was accepted
    part: Part  # the object as a part of the room, scene coordinates
    mesh: Mesh  # its surface upright, in the unit of its file, as its own USD file holds it
    layer: Sdf.Layer  # USD layer that the script made
    plan: Plan  # the plan by which it was placed


@dataclass(frozen=True, kw_only=True)
class PlacementConfig(SurfaceConfig):
    """Placement of an object.

    Attributes:
        pose: search for poses.
    """

    pose: PoseConfig
    drop_test: DropTestConfig = DropTestConfig()  # check that the object stays
    object: ObjectConfig = ObjectConfig()  # reading of object files


@dataclass(frozen=True, kw_only=True)
class InsertSettings:
    """Keys of `s2a insert`.

    Attributes:
        stage: the geometric.usd, or the insert.usda of an earlier insertion; it is not changed.
        object: a mesh or a USD stage; null if a list is given.
        label: name of the object in plain words; null if a list is given.
        objects: a YAML list of {object, label}, paths relative to it; null for a single object.
        prompt: placement hint in words, such as "put it next to the keyboard", or null.
        out: folder that receives insert.usda (open it instead of the stage; delete it to undo the insertion), objects/,
            descriptive.usda and insert.json.
        image: PNG file to write, an image of the first object in its place, or null.
        record: file to which the model's answers are added, for llm=replay, in place of earlier ones; null for none.
        surface: "regions" grows bounded surfaces; "ransac" is the baseline, one plane, and needs pose=paper.
        pose: "search" ranks all placements on a grid; "paper" is the baseline, random offsets until nothing collides.
        retries: answers of the model that may be rejected, per step.
        plans: number of plans that are requested while there is no room for the earlier ones.
        neighbours: objects near the place that are described to the model when it estimates the size.
        wish: "heed" refuses (exit 2) where the prompt cannot be met; "prefer" then takes another place, with a note.
        review: Let a vision model judge the object in its place, and plan once more if it is wrong.
        script: "plan" writes the script from the plan, "model" requests it; both run in the sandbox and are checked against it.
        llm: the language model.
        placement: placement of an object.
        sandbox: limits of scripts.
        camera: intrinsics and framing of the image.
    """

    stage: Path
    object: Path | None
    label: str | None
    objects: Path | None
    prompt: str | None
    out: Output
    image: Output | None
    record: Output | None
    surface: Literal["regions", "ransac"]
    pose: Literal["search", "paper"]
    retries: CountFromZero
    plans: Count
    neighbours: CountFromZero
    wish: Literal["heed", "prefer"]
    review: bool
    script: Literal["plan", "model"]
    llm: LlmConfig
    placement: PlacementConfig
    sandbox: SandboxConfig
    hulls: HullsConfig = HullsConfig()  # convex hulls of the object in its drop test
    camera: OrbitCamera

    @property
    def by_rules(self) -> bool:
        """No model reads the hint; the scripts are our own, and trusted."""
        return kind_of(self.llm) == "rules"
