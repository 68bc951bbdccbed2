"""Objects that are watched in their places, by convex pieces."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from s2a.certify.drop_test import SettleConfig, settle
from s2a.geometry.convex import hull
from s2a.geometry.decompose import one_hull
from s2a.geometry.mesh_ops import sample
from s2a.insert.pipeline import Watch
from s2a.insert.place.candidates import Spot
from s2a.insert.place.supports import nearby
from s2a.llm.usage_log import Record
from s2a.ranges import AtLeast, Count, Fraction
from s2a.scene import Mesh, Scene

FOOT = 0.03
"""What is below this share of an object's height is its foot."""
SAMPLES = 4000
"""Points on its surface, besides its vertices."""
AROUND = 0.05
"""Surroundings within this distance of an object take part in its drop [m]."""


@dataclass(frozen=True)
class PiecesConfig:
    """Convex pieces that stand for an object while it is watched.

    Attributes:
        full: share of its convex hull from which an object is taken for that.
        slices: level slices above its foot, each a convex hull.
        vertices: largest number a piece.
    """

    full: Fraction
    slices: Count
    vertices: Annotated[int, AtLeast(4)]


def drop(pieces: PiecesConfig, config: SettleConfig) -> Watch:
    """Return what drops an object at a spot and says whether it stays; an object's pieces are made once."""
    known: dict[int, tuple[Mesh, list[Mesh]]] = {}  # with the mesh, or another might get its address

    def watched(object: Mesh, spot: Spot, scene: Scene) -> Record:
        if id(object) not in known:
            known[id(object)] = object, _pieces(object, pieces)
        moved = [spot.pose.moved(piece) for piece in known[id(object)][1]]
        low, high = spot.pose.moved(object).bounds
        hangs_on = -spot.normal if spot.choice.relation == "hanging" else None
        found = settle(moved, nearby(scene, low - AROUND, high + AROUND), config, hangs_on)
        return {name: round(value, 5) if isinstance(value, float) else value for name, value in vars(found).items()}

    return watched


def _pieces(object: Mesh, config: PiecesConfig) -> list[Mesh]:
    """Return convex pieces of an upright object: its hull, where that fills in little, else its foot and level slices.

    Convex decomposition took one to three seconds, and its pieces follow a surface to a voxel only, on which a bottle leans.
    Slices are exact where it stands, fill in what is hollow, and what is between legs.
    """
    whole = one_hull(object, config.vertices)
    if not whole or _volume(object) > config.full * _volume(whole[0]):
        return whole
    low, high = object.bounds[:, 2].astype(np.float64)
    points = np.concatenate([object.vertices, sample(object, SAMPLES, seed=0)])
    edges = np.array([0.0, *np.linspace(FOOT, 1.0, config.slices + 1)]) * (high - low) + low
    slices = [points[(points[:, 2] >= a) & (points[:, 2] <= b)] for a, b in itertools.pairwise(edges)]
    found = [hull(piece, config.vertices) for piece in slices if len(piece)]
    return [piece for piece in found if piece is not None]


def _volume(mesh: Mesh) -> float:
    """Return what a surface encloses [m^3]; of an open one, about that."""
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces].astype(np.float64), 1, 0)
    return abs(float(np.einsum("ij,ij->", a, np.cross(b, c)))) / 6.0
