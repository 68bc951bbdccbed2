"""A room that fills up: what of it does not depend on the object that is to come is found once."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from s2a.geometry.regions import Region, RegionConfig
from s2a.insert import describe
from s2a.insert.place.fit import NoRoom
from s2a.insert.place.supports import SurfaceConfig, target_mesh, target_regions
from s2a.insert.place.swept_volumes import swept_volumes
from s2a.scene import Mesh, Scene

if TYPE_CHECKING:
    from s2a.insert.pipeline import Inserted


class RoomState:
    """A room that fills up; a copy (`copy.copy`) fills up on its own.

    Attributes:
        scene: the room with what was inserted so far.
        geometry_free_text: USD text of its stage without geometry, before any insertion.
        volumes: swept volumes of its drawers and doors.
    """

    def __init__(self, scene: Scene, geometry_free_text: str, config: SurfaceConfig) -> None:
        self.scene, self.geometry_free_text, self._config = scene, geometry_free_text, config.regions
        self.volumes = swept_volumes(scene)
        self._supports = describe.survey(scene, config.regions)
        self._lines = describe.describe(scene, self._supports)
        self._levels = {part_id: regions for part_id, regions in self._supports.items() if regions}
        self._unseen: list[tuple[Scene, Inserted]] = []

    @property
    def supports(self) -> describe.Supports:
        """What the room's parts can carry: of what an object was put on, what it leaves."""
        self._survey()
        return self._supports

    @property
    def lines(self) -> list[dict[str, Any]]:
        """The room's description."""
        self._survey()
        return self._lines

    def levels(self, target: str) -> list[Region]:
        """Return the level support regions of a part, with the room that everything else leaves now.

        Raises:
            NoRoom: nothing of it looks upwards.
            InputError: no such part, or one without a surface.
        """
        self._survey()
        if target not in self._levels:
            if not describe.faces_up(target_mesh(self.scene, target)):
                raise NoRoom("nothing of it looks upwards")
            self._levels[target] = target_regions(self.scene, target, self._config, ("horizontal", "inside"))
        return self._levels[target]

    def add(self, inserted: Inserted) -> None:
        """Take an object into the room; what that changes is looked at when the next one comes."""
        parts = {**self.scene.parts, inserted.placement.part_id: inserted.part}
        self.scene = Scene(self.scene.name, parts, self.scene.origin)
        self._unseen = [*self._unseen, (self.scene, inserted)]

    def _survey(self) -> None:
        """Look at what the last objects changed."""
        if not self._unseen:
            return
        for scene, inserted in self._unseen:
            names = inserted.candidate.target, inserted.placement.part_id
            changed = describe.survey(scene, self._config, names)
            self._supports = self._supports | changed
            mesh, levels = inserted.part.mesh, self._levels.items()
            apart = {i: regions for i, regions in levels if not _over(mesh, regions, self._config)}
            self._levels = apart | {i: regions for i, regions in changed.items() if regions}
        self._unseen = []
        self._lines = describe.describe(self.scene, self._supports)


def _over(mesh: Mesh, regions: list[Region], config: RegionConfig) -> bool:
    """Whether a thing may take some of the room over regions."""
    return any(_meets(mesh, region, config.search_height) for region in regions)


def _meets(mesh: Mesh, region: Region, reach: float) -> bool:
    """Whether the box around a thing meets the box of what is over a region, up to a height [m]."""
    rows, columns = region.support.shape
    corners = region.points(np.array([(-1, -1), (rows + 1, -1), (-1, columns + 1), (rows + 1, columns + 1)]))
    corners = np.concatenate([corners, corners + reach * region.normal])
    low, high = mesh.bounds
    return bool((low <= corners.max(axis=0)).all() and (high >= corners.min(axis=0)).all())
