"""Every thing that a mesh file of each format can hold is read as its specification says, warned of, or refused in one line."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
from mesh_features import FEATURES, Feature, table
from mesh_variants import VARIANTS
from plain_files import PLAIN_FILES

from s2a.core.errors import InputError
from s2a.scan import source
from s2a.scan.imported import bake
from s2a.scan.source import ears

FILES = FEATURES + VARIANTS + PLAIN_FILES
DOCS = Path(__file__).parents[2] / "docs" / "own_scan.md"
BEGIN, END = "<!-- formats: begin -->\n", "<!-- formats: end -->\n"


def name(feature: Feature) -> str:
    return f"{feature.format}: {feature.name}"


@pytest.mark.parametrize("feature", FILES, ids=name)
def test_a_file_is_read_as_its_format_says(feature: Feature, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = tmp_path / f"file{feature.ending}"
    feature.write(path)
    if feature.refused:
        with pytest.raises(InputError) as caught:
            source.read(path)
        assert "\n" not in str(caught.value) and all(
            word in str(caught.value) for word in (path.name, *feature.refused)
        )
        return
    mesh = source.read(path)
    assert all(word in caplog.text for word in feature.warned), caplog.text
    assert bool(caplog.records) == bool(feature.warned), caplog.text
    corners = mesh.vertices[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    areas = np.linalg.norm(normals, axis=1)
    assert feature.faces in (None, len(mesh.faces))
    assert areas.sum() == pytest.approx(feature.area, rel=1e-4) and (areas.min() > 0 or feature.faces is None)
    if feature.facing is not None:
        assert normals.sum(axis=0) == pytest.approx(feature.area * np.array(feature.facing), abs=1e-4)
    baked = bake(mesh, np.inf)
    assert (
        len(np.unique(mesh.faces)) >= len(baked.vertices) >= len(np.unique(np.round(corners.reshape(-1, 3), 3), axis=0))
    )
    if feature.colors is not None:
        distance = np.abs(baked.colors[:, None].astype(int) - np.array(feature.colors)).max(axis=2)
        assert distance.min(axis=1).max() <= 1 and distance.min(axis=0).max() <= 1, np.unique(baked.colors, axis=0)


@pytest.mark.parametrize("format", ["glTF", "OBJ", "PLY", "USD", "STL", "OFF"])
@pytest.mark.parametrize("seed", range(3))
def test_damaged_files_are_read_or_refused_but_never_crash(format: str, seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    files = [feature for feature in FILES if feature.format == format]
    for number in rng.choice(len(files), 25):
        path = tmp_path / f"file{files[number].ending}"
        files[number].write(path)
        data = bytearray(path.read_bytes())
        for place in rng.choice(len(data), rng.integers(1, 6)):
            data[place] = rng.integers(256)
        path.write_bytes(data[: rng.integers(len(data))] if rng.random() < 0.2 else data)
        try:
            bake(source.read(path), np.inf)
        except InputError as error:
            assert "\n" not in str(error) and path.name in str(error)


def test_the_lists_in_the_docs_are_those_that_were_tested() -> None:
    assert DOCS.read_text().partition(BEGIN)[2].partition(END)[0] == table(FILES)


def test_a_floor_plan_of_many_corners_is_cut_at_once() -> None:
    """A comb of 100 teeth 1 wide and 2 high on a bar 1 high and 199 wide."""
    teeth = [point for x in range(198, -1, -2) for point in ((x + 1, 3), (x, 3), (x, 1), (x - 1, 1))][:-2]
    outline = np.array([(0, 0, 0), (199, 0, 0), *((x, y, 0) for x, y in teeth)], float)
    start = time.process_time()
    triangles = outline[ears(outline)]
    area = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])[:, 2] / 2
    assert area.min() >= 0 and area.sum() == pytest.approx(199 + 200)
    assert time.process_time() - start < 5
