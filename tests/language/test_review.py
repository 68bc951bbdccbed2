"""The review of a result: a model that sees is asked once, and once for another plan where it does not look right."""

from __future__ import annotations

import base64
import io
import json
from pathlib import Path

import numpy as np
import pytest
from fake_llm import Said, endpoint, message
from PIL import Image
from rough_furniture import at, block, sheet

from s2a.core import config
from s2a.language.commands import insert as command
from s2a.scene.scene import Part, Scene
from s2a.scene.usd import geometric

SIZE = {"noun": "mug", "height": [0.08, 0.12], "longest": [0.09, 0.14], "unit": "cm", "reason": "a mug"}
WRONG = {"right": False, "problem": "it should stand on the cabinet"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the stage of a room with a desk and a cabinet, and a mug in centimetres."""
    folder = tmp_path_factory.mktemp("room")
    parts = {
        "floor_1": Part("floor", sheet((-1, 3), (-2, 2.6), 0.0, 0.1)),
        "desk_2": Part("desk", sheet((0, 1.2), (0, 0.6), 0.74)),
        "cabinet_5": Part("cabinet", at(block(0.6, 0.5, 0.6), 2.2, 0.55, 0.0)),
    }
    geometric.write(Scene("room", parts), folder / "geometric.usd")
    mesh = block(8.0, 8.0, 9.5)
    lines = [f"v {x} {y} {z} 1 0 0" for x, y, z in mesh.vertices] + [f"f {a} {b} {c}" for a, b, c in mesh.faces + 1]
    (folder / "mug.obj").write_text("\n".join(lines) + "\n")
    return folder


def planned(target: str) -> dict:
    choice = {"target": target, "surface": "horizontal", "relation": "on", "height": None, "reason": "there"}
    return {"up": "+z", "front": "-y", "near": None, "choices": [choice], "place": [], "declined": ""}


def words(*values: dict) -> list[Said]:
    return [message(json.dumps(value)) for value in values]


def reviewed(folder: Path, out: Path, monkeypatch: pytest.MonkeyPatch, *answers: dict) -> tuple[dict, list]:
    """Insert a mug by a model with these answers; return the record and the requests."""
    with endpoint(*words(*answers)) as there:
        monkeypatch.setenv("OPENAI_API_KEY", "any")
        monkeypatch.setenv("OPENAI_BASE_URL", there.url)
        options = [
            f"stage={folder / 'geometric.usd'}",
            f"object={folder / 'mug.obj'}",
            "label=mug",
            f"out={out}",
            "review=true",
        ]
        command.run(config.load(command.Config, config.compose("insert", [*options, "llm=chat", "llm.attempts=0"])))
        return json.loads((out / "insert.json").read_text())["objects"][0], there.asked


def mug_pixels(url: str) -> int:
    """Return the number of red pixels in an image of a message."""
    png = base64.b64decode(url.removeprefix("data:image/png;base64,"))
    red, green, blue = np.moveaxis(np.asarray(Image.open(io.BytesIO(png)).convert("RGB")).astype(int), -1, 0)
    return int(((red > 2 * green) & (red > 2 * blue)).sum())


@pytest.mark.slow
def test_what_looks_right_stays_after_one_look_from_afar_and_near(folder, tmp_path, monkeypatch):
    record, requests = reviewed(
        folder, tmp_path / "out", monkeypatch, planned("desk_2"), SIZE, {"right": True, "problem": ""}
    )
    assert record["surface"]["target"] == "desk_2"
    assert record["review"]["right"]
    assert sorted(entry["step"] for entry in record["answers"]) == ["plan", "review", "scale", "script"]
    text, *images = requests[-1]["messages"][1]["content"]
    assert "mug" in text["text"]
    wide, close = (mug_pixels(image["image_url"]["url"]) for image in images)
    assert close > 4 * wide > 0


@pytest.mark.slow
def test_what_does_not_look_right_is_placed_by_one_more_plan(folder, tmp_path, monkeypatch):
    answers = planned("desk_2"), SIZE, WRONG, planned("cabinet_5")
    record, requests = reviewed(folder, tmp_path / "out", monkeypatch, *answers)
    assert record["surface"]["target"] == "cabinet_5"
    assert "it should stand on the cabinet" in requests[-1]["messages"][-1]["content"]
    assert len(requests) == 4  # it is not looked at again


def test_the_first_place_is_kept_where_the_second_plan_has_no_room(folder, tmp_path, monkeypatch):
    answers = (
        planned("desk_2"),
        SIZE,
        WRONG,
        {**planned("desk_2"), "choices": [], "declined": "there is no better place"},
    )
    record, _ = reviewed(folder, tmp_path / "out", monkeypatch, *answers)
    assert record["surface"]["target"] == "desk_2"
    assert "there is no better place" in record["review"]["kept"]
    assert (tmp_path / "out/insert.usda").exists()
