"""The plane of a scanned front: noise that neighbours share, rounded borders, faces of all sizes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from flat_cabinet import FRONT, cabinet, upright, with_part

from s2a.prepare.refine_front import Faces, fitted_plane, seen_front
from s2a.scan.evidence.front import front
from s2a.scan.evidence.surface import ScanSurface
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.scene import Mesh

WIDE, HIGH = 0.6, 0.2
"""[m] Sides of the cabinet's drawer front."""


def slope(mesh: Mesh) -> float:
    """Return how far the normal of a drawer front looks up, of the hand-made cabinet [deg]."""
    scene = cabinet()
    faces = Faces(ScanSurface(with_part(scene, "drawer_2", replace(scene.parts["drawer_2"], mesh=mesh))))
    found = front(faces.surface, "drawer_2")
    assert found is not None
    seen = seen_front(faces, "drawer_2", found)
    assert seen is not None
    return float(np.degrees(np.arctan2(seen.normal[2], seen.normal[0])))


def split(mesh: Mesh, below: float) -> Mesh:
    """Return the same surface with four triangles in place of each one below a height [m]."""
    low = mesh.vertices[mesh.faces][:, :, 2].mean(axis=1) < below
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces[low]], 1, 0)
    ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
    corners = np.concatenate([np.stack(t, axis=1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    small = Mesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
    return merge([Mesh(mesh.vertices, mesh.faces[~low]), small])


def test_an_edge_that_fusion_rounds_off_tilts_no_front() -> None:
    flat = upright((-WIDE / 2, WIDE / 2), (0.6, 0.6 + HIGH))
    fine = split(split(flat, 0.624), 0.624)
    edge = np.maximum(0.0, 0.606 - fine.vertices[:, 2])  # over a voxel
    rounded = Mesh(fine.vertices - np.outer(edge / 3.0, (1.0, 0.0, 0.0)), fine.faces)
    assert rounded.vertices[:, 0].min() == pytest.approx(FRONT - 0.002)
    assert abs(slope(rounded)) < 0.01  # all but the edge is flat


def test_a_front_is_tilted_alike_however_its_surface_is_cut_into_triangles() -> None:
    flat = upright((-WIDE / 2, WIDE / 2), (0.6, 0.6 + HIGH))
    wave = 0.0015 * np.sin(2 * np.pi * (flat.vertices[:, 2] - 0.6) / 0.13)
    bent = Mesh(flat.vertices + np.outer(wave, (1.0, 0.0, 0.0)), flat.faces)
    assert slope(split(split(bent, 0.66), 0.66)) == pytest.approx(slope(bent), abs=0.005)


@pytest.mark.parametrize("shared", [0.03, 0.05, 0.08])
def test_deviations_hold_the_truth_over_whatever_length_noise_is_shared(shared: float) -> None:
    y, z = (0.01 * (np.arange(n) + 0.5) for n in (60, 24))
    flat = np.stack(np.meshgrid(y, z, indexing="ij"), axis=-1).reshape(-1, 2)
    rng, plane = np.random.default_rng(0), np.array([0.01, 0.02, -0.03])
    off = []
    for _ in range(150):
        left, right = lattice(y, shared, rng), lattice(z, shared, rng)
        noise = 0.001 * left @ rng.normal(size=(left.shape[1], right.shape[1])) @ right.T
        found = fitted_plane(flat, noise.ravel() + plane[0] + flat @ plane[1:], 1e-4)
        assert found is not None
        off.append((found[0] - plane) / np.sqrt(np.diag(found[1])))
    spread = np.sqrt((np.array(off)[:, 1:] ** 2).mean(axis=0))
    assert ((spread > 0.7) & (spread < 1.35)).all(), spread


def lattice(line: np.ndarray, width: float, rng: np.random.Generator) -> np.ndarray:
    """Return how a scanner's noise at places on a line [place] hangs on that of a lattice, linearly, shape [place knot]."""
    knots = np.arange(-1, int(line.max() / width) + 3)
    return np.maximum(0.0, 1.0 - np.abs(line[:, None] / width + rng.random() - knots))


def test_a_moulding_tilts_no_front() -> None:
    y, z = (0.01 * (np.arange(n) + 0.5) for n in (60, 24))
    flat = np.stack(np.meshgrid(y, z, indexing="ij"), axis=-1).reshape(-1, 2)
    height = np.random.default_rng(0).normal(0.0, 0.0005, len(flat)) + 0.01 * (flat[:, 1] > 0.2)
    found = fitted_plane(flat, height, 1e-4)
    assert found is not None
    assert np.degrees(np.abs(found[0][1:])).max() < 0.06


def test_too_little_of_a_front_has_no_plane() -> None:
    assert fitted_plane(np.zeros((2, 2)), np.zeros(2), 1e-4) is None
    line = np.stack([np.linspace(0.0, 0.02, 40), np.zeros(40)], axis=1)
    assert fitted_plane(line, np.zeros(40), 1e-6) is None
