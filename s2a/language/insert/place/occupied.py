"""What is occupied over a region: cells in layers, of the room and of what its drawers and doors sweep."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from s2a.core.ranges import Count, Fraction, NotNegative, Numbers, Positive
from s2a.language.insert.place.preferences import PreferenceConfig
from s2a.language.insert.place.supports import BASIN
from s2a.language.insert.place.swept_volumes import SweptVolume, fill
from s2a.scene.geometry.occupancy import Grid, occupied_layers
from s2a.scene.geometry.regions import Region
from s2a.scene.scene import Mesh


@dataclass(frozen=True)
class SearchConfig:
    """Search on the occupancy grid.

    Attributes:
        turns: yaws to test, relative to the facing direction of the region [deg].
        layers: number of occupancy layers between the region and the top of the object.
        contact_height: points lower than this above the lowest one touch the support [m].
        samples: points sampled on the object's surface.
        min_supported_fraction: smallest fraction of the touching cells that must be supported.
        margin: clearance kept around the object [m].
        max_useful_clearance: clearance beyond this does not improve a placement [m].
        max_overhang: largest fraction of the object, seen from above, that is beyond its support.
        max_placements: placements ranked per yaw.
        clearance_weight: weight of the clearance around the object.
        facing_weight: weight of the facing direction.
        neighbour_weight: weight of the distance to the requested neighbour.
        backing_weight: weight of a back that is against something, for relation "against".
        neighbour_distance: distance over which the neighbour's weight decays [m].
        habits: where people put things.
    """

    turns: Numbers
    layers: Count
    contact_height: NotNegative
    samples: Count
    min_supported_fraction: Fraction
    margin: NotNegative
    max_useful_clearance: Positive
    max_overhang: Fraction
    max_placements: Count
    clearance_weight: float
    facing_weight: float
    neighbour_weight: float
    backing_weight: float
    neighbour_distance: Positive
    habits: PreferenceConfig


@dataclass(frozen=True)
class OccupancyGrid:
    """The padded occupancy grid over a region.

    Attributes:
        pad: cells added on each side of the region.
        carries: supported cells with clearance, shape [row column].
        layers: occupied cells by layer, shape [layer row column].
        edges: heights of the layers' borders above the region [m], shape [layer + 1].
        beyond: cells beyond the outline of the region, over which objects would overhang, shape [row column].
    """

    pad: int
    carries: np.ndarray
    layers: np.ndarray
    edges: np.ndarray
    beyond: np.ndarray


def occupancy_grid(
    region: Region,
    radius: float,
    height: float,
    obstacles: Sequence[Mesh],
    volumes: list[SweptVolume],
    config: SearchConfig,
) -> OccupancyGrid:
    """Return the grid for an object of a radius and height [m] among obstacles and the swept volumes of doors and drawers."""
    pad = int(np.ceil(radius / region.cell)) + 2
    carries = np.pad(region.free, pad)
    edges = np.linspace(config.contact_height, max(height, 2 * config.contact_height), config.layers + 1)
    origin = region.points(np.array([[-pad, -pad]]))[0]
    raster = Grid(region.axes, origin, region.cell, carries.shape, edges[0], edges[-1], config.layers)
    layers, _ = occupied_layers(obstacles, raster)
    for volume in volumes:
        fill(layers, edges, region, pad, volume, config.contact_height)
    grow = max(1, round(config.margin / region.cell))
    grown = np.stack([ndimage.binary_dilation(layer, iterations=grow) for layer in layers])
    # What stands at the border hides it from the scanner: the outline counts, and a cell of tolerance.
    outline = ndimage.binary_dilation(ndimage.binary_fill_holes(np.pad(region.support, pad)))
    # What is in a basin may reach over its rim.
    beyond = ~outline & (region.rim_fraction <= BASIN)
    return OccupancyGrid(pad, carries, grown, edges, beyond)
