"""The state of a room between insertions: what does not depend on the next object is computed once."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from s2a.language.insert import describe
from s2a.language.insert.place.fit import NoRoom, swept_volumes
from s2a.language.insert.place.supports import SurfaceConfig, target_mesh, target_regions
from s2a.scene.geometry.regions import Region, RegionConfig
from s2a.scene.scene import Mesh, Scene

if TYPE_CHECKING:
    from s2a.language.insert.context import Inserted


class RoomState:
    """A room with the objects inserted so far; a copy (`copy.copy`) is independent of the original.

    Attributes:
        scene: the room with the objects inserted so far.
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
        """Support regions of the room's parts, with what the inserted objects leave free."""
        self._survey()
        return self._supports

    @property
    def lines(self) -> list[dict[str, Any]]:
        """The room's description."""
        self._survey()
        return self._lines

    def levels(self, target: str) -> list[Region]:
        """Return the horizontal support regions of a part, with what all other parts leave free.

        Raises:
            NoRoom: none of its surface faces up.
            InputError: no such part, or one without a surface.
        """
        self._survey()
        if target not in self._levels:
            if not describe.faces_up(target_mesh(self.scene, target)):
                raise NoRoom("nothing of it looks upwards")
            self._levels[target] = target_regions(self.scene, target, self._config, ("horizontal", "inside"))
        return self._levels[target]

    def add(self, inserted: Inserted) -> None:
        """Add an object; the survey is updated when it is needed next."""
        parts = {**self.scene.parts, inserted.placement.part_id: inserted.part}
        self.scene = Scene(self.scene.name, parts, self.scene.origin)
        self._unseen = [*self._unseen, (self.scene, inserted)]

    def _survey(self) -> None:
        """Update the survey around the last objects."""
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
    """Return True if a mesh may occupy space over regions."""
    return any(_meets(mesh, region, config.search_height) for region in regions)


def _meets(mesh: Mesh, region: Region, reach: float) -> bool:
    """Return True if the box around a mesh meets the box over a region, up to a height [m]."""
    rows, columns = region.support.shape
    corners = region.points(np.array([(-1, -1), (rows + 1, -1), (-1, columns + 1), (rows + 1, columns + 1)]))
    corners = np.concatenate([corners, corners + reach * region.normal])
    low, high = mesh.bounds
    return bool((low <= corners.max(axis=0)).all() and (high >= corners.min(axis=0)).all())
