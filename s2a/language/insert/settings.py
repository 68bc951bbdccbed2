"""Settings of an insertion: the keys of `s2a insert`, and how they become the pipeline's configuration."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from s2a.core.bounds import Count, CountFromZero
from s2a.language.insert.context import InsertConfig
from s2a.language.insert.object_file import ObjectConfig
from s2a.language.insert.place.contact import PoseConfig
from s2a.language.insert.place.supports import SurfaceConfig
from s2a.language.insert.stability import DropTestConfig, HullsConfig
from s2a.language.llm.client import LlmConfig, kind_of
from s2a.language.sandbox.jail import SandboxConfig
from s2a.scene.geometry.camera import OrbitCamera
from s2a.scene.geometry.planes import RansacConfig
from s2a.scene.geometry.regions import RegionConfig


@dataclass(frozen=True)
class PlacementConfig:
    """Placement of an object.

    Attributes:
        regions: growth of support regions.
        surface: "regions" or "ransac".
        ransac: the baseline's plane.
        pose: search for poses.
        drop_test: check that the object stays.
        object: reading of object files.
    """

    regions: RegionConfig
    surface: Literal["regions", "ransac"]
    ransac: RansacConfig
    pose: PoseConfig
    drop_test: DropTestConfig
    object: ObjectConfig


@dataclass(frozen=True)
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
        record: file to which the answers of the model are appended, for llm=replay; null for none.
        surface: "regions" grows bounded surfaces; "ransac" is the baseline, one plane, and needs pose=paper.
        pose: "search" ranks all placements on a grid; "paper" is the baseline, random offsets until nothing collides.
        retries: answers of the model that may be rejected, per step.
        plans: number of plans that are requested while there is no room for the earlier ones.
        neighbours: objects near the place that are described to the model when it estimates the size.
        wish: "heed" refuses (exit 2) where the prompt cannot be met; "prefer" then takes another place, and says so.
        review: Ask a model that sees whether the object looks right in its place, and once for another plan if it does not.
        script: "plan" writes the script from the plan, which is confined and compared all the same; "model" asks for it.
        llm: the language model.
        placement: placement of an object.
        sandbox: limits of scripts.
        hulls: convex hulls of the object in its drop test.
        camera: intrinsics and framing of the image.
    """

    stage: Path
    object: Path | None
    label: str | None
    objects: Path | None
    prompt: str | None
    out: Path
    image: Path | None
    record: Path | None
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
    hulls: HullsConfig
    camera: OrbitCamera

    @property
    def pipeline(self) -> InsertConfig:
        """Configuration of the pipeline; scripts of the rules are our own and trusted."""
        placement = self.placement
        return InsertConfig(
            SurfaceConfig(placement.surface, placement.regions, placement.ransac),
            placement.pose,
            placement.object,
            self.sandbox,
            self.retries,
            self.plans,
            self.neighbours,
            self.wish,
            self.script,
            rules=kind_of(self.llm) == "rules",
            trusted=kind_of(self.llm) == "rules",
        )
