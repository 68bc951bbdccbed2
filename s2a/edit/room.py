"""A room that fills up: what of it does not depend on the object that is to come is found once."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from s2a.edit import describe
from s2a.edit.fit import NoRoom
from s2a.edit.openings import openings
from s2a.edit.surfaces import SurfaceConfig, target_mesh, target_regions
from s2a.geometry.regions import Region, RegionConfig
from s2a.scene import Mesh, Scene

if TYPE_CHECKING:
    from s2a.edit.insert import Inserted


class Room:
    """A room that fills up.

    Attributes:
        scene: the room with what was inserted so far.
        skeleton: text of its stage, without it.
        ways: of its drawers and doors.
        supports: what its parts can carry.
        lines: its description.
    """

    def __init__(self, scene: Scene, skeleton: str, config: SurfaceConfig) -> None:
        self.scene, self.skeleton, self._config = scene, skeleton, config.regions
        self.ways = openings(scene)
        self.supports = describe.survey(scene, config.regions)
        self.lines = describe.describe(scene, self.supports)
        self._levels = {part_id: regions for part_id, regions in self.supports.items() if regions}

    def levels(self, target: str) -> list[Region]:
        """Return the level support regions of a part, with the room that everything else leaves now.

        Raises:
            NoRoom: nothing of it looks upwards.
            InputError: no such part, or one without a surface.
        """
        if target not in self._levels:
            if not describe.looks_up(target_mesh(self.scene, target)):
                raise NoRoom("nothing of it looks upwards")
            self._levels[target] = target_regions(self.scene, target, self._config, ("horizontal", "inside"))
        return self._levels[target]

    def add(self, inserted: Inserted) -> None:
        """Take an object into the room."""
        name, part = inserted.placement.part_id, inserted.part
        self.scene = Scene(self.scene.name, {**self.scene.parts, name: part}, self.scene.origin)
        changed = describe.survey(self.scene, self._config, (inserted.spot.target, name))
        self.supports |= changed
        self.lines = describe.describe(self.scene, self.supports)
        apart = {i: regions for i, regions in self._levels.items() if not _over(part.mesh, regions, self._config)}
        self._levels = apart | {part_id: regions for part_id, regions in changed.items() if regions}


def _over(mesh: Mesh, regions: list[Region], config: RegionConfig) -> bool:
    """Whether a thing may take some of the room over regions."""
    return any(_meets(mesh, region, config.reach) for region in regions)


def _meets(mesh: Mesh, region: Region, reach: float) -> bool:
    """Whether the box around a thing meets the box of what is over a region, up to a height [m]."""
    rows, columns = region.support.shape
    corners = region.points(np.array([(-1, -1), (rows + 1, -1), (-1, columns + 1), (rows + 1, columns + 1)]))
    corners = np.concatenate([corners, corners + reach * region.normal])
    low, high = mesh.bounds
    return bool((low <= corners.max(axis=0)).all() and (high >= corners.min(axis=0)).all())
