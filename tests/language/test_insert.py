"""One object into a room, from words to the layer over its stage."""

from __future__ import annotations

import json
import logging
import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml
from fake_llm import Said, endpoint, failure, message
from few import few
from pxr import Usd, UsdGeom
from rough_furniture import at, block, sheet
from scipy.spatial.transform import Rotation

from s2a.commands import cli
from s2a.core import config
from s2a.core.errors import CheckFailed, InputError
from s2a.language.ask import Request, parse
from s2a.language.commands import insert as command
from s2a.language.insert import describe, pipeline, prompts
from s2a.language.insert import plan as scale
from s2a.language.insert.fit import Pose
from s2a.language.insert.object_file import ObjectConfig, ObjectFile, read_object, upright
from s2a.language.insert.plan import Plan, Size, checked, fit_scale
from s2a.language.insert.prompts import write_script
from s2a.language.insert.rules import brands, known, rules, table
from s2a.language.insert.stable_pose import concavities, cross_sections, settled_axis, tilt_margins
from s2a.language.insert.wish import wished
from s2a.language.insert.wish_check import read_wish
from s2a.language.sandbox.diff import Placement
from s2a.language.sandbox.jail import STAGE
from s2a.language.sandbox.policy import AllowConfig, check
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.geometry.mesh_query import crossing
from s2a.scene.scene import Joint, Mesh, Part, Scene
from s2a.scene.usd import geometric

MUG = Size("mug", (0.08, 0.12), (0.09, 0.14), "unknown", "")


def scene() -> Scene:
    """A room with a desk at 0.74 m that carries a keyboard and a crate, and a cabinet whose drawer slides out towards -y."""
    front = at(block(0.5, 0.02, 0.3), 2.2, 0.28, 0.1)
    return Scene(
        "room",
        {
            "floor_1": Part("floor", sheet((-1, 3), (-2, 2.6), 0.0, 0.05)),
            "desk_2": Part("desk", sheet((0, 1.2), (0, 0.6), 0.74)),
            "keyboard_3": Part("keyboard", at(block(0.4, 0.14, 0.03), 0.3, 0.2, 0.741)),
            "crate_4": Part("crate", at(block(0.25, 0.25, 0.3), 1.0, 0.4, 0.741)),
            "cabinet_5": Part("cabinet", at(block(0.6, 0.5, 0.6), 2.2, 0.55, 0.0)),
            "drawer_6": Part(
                "drawer", front, "cabinet_5", Joint("prismatic", (0, -1, 0), (2.2, 0.28, 0.2), (0.0, 0.4))
            ),
        },
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a stage, and boxes of a mug's and a book's shape as files in centimetres and millimetres."""
    folder = tmp_path_factory.mktemp("room")
    geometric.write(scene(), folder / "geometric.usd")
    write(block(8.0, 8.0, 9.5), folder / "mug.obj")
    write(block(150.0, 220.0, 25.0), folder / "book.obj")
    return folder


def write(mesh: Mesh, path: Path) -> None:
    lines = [f"v {x} {y} {z}" for x, y, z in mesh.vertices] + [f"f {a} {b} {c}" for a, b, c in mesh.faces + 1]
    path.write_text("\n".join(lines) + "\n")


@cache
def composed(*options: str) -> dict:
    return config.compose("insert", ["stage=none", "out=none", "llm=rules", *options])


def settings(folder: Path, out: Path, *options: str, **values: object) -> command.Config:
    """Return the command's settings: options are composed, which takes half a second, once; values are set."""
    given = {"stage": folder / "geometric.usd", "out": out, **values}
    llm = {**composed(*options)["llm"], **given.pop("llm", {})}
    return config.load(command.Config, {**composed(*options), **given, "llm": llm})


def mug(folder: Path, out: Path, *options: str, **values: object) -> dict:
    """Insert a mug; return its record."""
    command.run(settings(folder, out, *options, object=folder / "mug.obj", label="coffee mug", **values))
    return json.loads((out / "insert.json").read_text())["objects"][0]


@pytest.mark.slow
def test_a_mug_stands_on_the_desk_as_a_layer_over_an_untouched_stage(folder, tmp_path):
    before = (folder / "geometric.usd").read_bytes()
    record = mug(folder, tmp_path / "out")
    assert (folder / "geometric.usd").read_bytes() == before
    steps = ["describe", "plan", "scale", "surface", "pose", "script", "verify", "answers", "total"]
    assert [step for step in steps if step not in record] == []
    assert record["surface"]["target"] == "desk_2"
    assert record["scale"]["method"] == "unit cm"
    assert (tmp_path / "out/insert.usda").stat().st_size < 1200
    assert "coffee_mug_7" in (tmp_path / "out/descriptive.usda").read_text()
    found = geometric.read(tmp_path / "out/insert.usda")
    assert list(found.parts) == [*scene().parts, "coffee_mug_7"]
    assert all(found.parts[i] == part for i, part in geometric.read(folder / "geometric.usd").parts.items())
    part = found.parts["coffee_mug_7"]
    assert part.label == "coffee mug"
    assert np.ptp(part.mesh.bounds, axis=0)[2] == pytest.approx(0.095, abs=1e-4)
    assert part.mesh.bounds[0, 2] == pytest.approx(0.74, abs=0.004)


@pytest.mark.slow
def test_two_runs_from_one_recording_write_the_same_bytes(folder, tmp_path):
    answers = tmp_path / "answers.json"
    mug(folder, tmp_path / "a/out", record=answers)
    mug(folder, tmp_path / "b/out", "llm=replay", llm={"answers": answers})
    for file in ("insert.usda", "objects/coffee_mug_7.usdc"):
        assert (tmp_path / "a/out" / file).read_bytes() == (tmp_path / "b/out" / file).read_bytes()


@pytest.mark.slow
def test_a_wish_comes_before_habit(folder, tmp_path):
    record = mug(folder, tmp_path / "out", prompt="put it next to the keyboard")
    assert record["plan"]["near"] == "keyboard_3"
    part = geometric.read(tmp_path / "out/insert.usda").parts["coffee_mug_7"]
    keyboard = scene().parts["keyboard_3"].mesh.bounds
    gap = np.maximum(keyboard[0] - part.mesh.bounds[1], part.mesh.bounds[0] - keyboard[1])[:2]
    assert np.linalg.norm(np.maximum(gap, 0)) < 0.2
    assert mug(folder, tmp_path / "floor", prompt="on the floor")["surface"]["target"] == "floor_1"


@pytest.mark.slow
def test_several_objects_keep_out_of_each_other_and_what_fails_is_told(folder, tmp_path):
    entries = [{"object": "mug.obj", "label": "coffee mug"}] * 2 + [{"object": "no.obj", "label": "vase"}]
    (folder / "list.yaml").write_text(yaml.safe_dump([*entries, {"object": "book.obj", "label": "novel"}]))
    with pytest.raises(CheckFailed, match=r"3 of 4 objects[\s\S]*not 'vase': .*no such file"):
        command.run(settings(folder, tmp_path / "out", objects=folder / "list.yaml"))
    parts = geometric.read(tmp_path / "out/insert.usda").parts
    added = [parts[i].mesh for i in parts if i not in scene().parts]
    assert [i for i in parts if i not in scene().parts] == [
        "coffee_mug_8",
        "coffee_mug_9",
        "novel_7",
    ]  # the big one first
    assert all(crossing(a, b) is None for n, a in enumerate(added) for b in added[:n])


@pytest.mark.slow
def test_an_insertion_goes_over_an_insertion(folder, tmp_path):
    mug(folder, tmp_path / "one")
    stage = tmp_path / "one/insert.usda"
    command.run(settings(folder, tmp_path / "two", stage=stage, object=folder / "book.obj", label="novel"))
    assert list(geometric.read(tmp_path / "two/insert.usda").parts)[-2:] == ["coffee_mug_7", "novel_8"]


@pytest.mark.slow
def test_an_insertion_takes_neither_the_place_of_its_ground_nor_of_its_recording(folder, tmp_path):
    one, two = tmp_path / "one", tmp_path / "two"
    mug(folder, one)
    command.run(settings(folder, two, stage=one / "insert.usda", object=folder / "book.obj", label="novel"))
    before = sorted(path.read_bytes() for path in one.rglob("*") if path.is_file())
    for stage in (one / "insert.usda", two / "insert.usda"):  # what lies under the stage is needed, too
        with pytest.raises(InputError, match="would be replaced with .*insert.usda' in it"):
            command.run(settings(folder, one, stage=stage, object=folder / "book.obj", label="novel"))
    with pytest.raises(InputError, match="would be replaced with .*answers.json' in it"):
        mug(folder, one, record=one / "answers.json")
    with pytest.raises(InputError, match="not empty and has no insert.json"):
        mug(folder, folder)
    assert sorted(path.read_bytes() for path in one.rglob("*") if path.is_file()) == before


@pytest.mark.parametrize(
    ("label", "part_id"),
    [
        ("stapler (red)", "stapler_red_7"),
        ("Coca-Cola®", "coca_cola_7"),
        ("café & crème", "cafe_creme_7"),
        ("100% cotton towel", "object_100_cotton_towel_7"),
        ("茶", "object_7"),
        ("a" * 39 + " b", "a" * 39 + "_7"),
        ("it's my_cup", "it_s_my_cup_7"),
    ],
)
def test_any_label_makes_a_name_that_a_script_may_spell(label, part_id):
    planned = pipeline.placement(scene(), label, Pose((0.1, 0.2, 0.3), (0.0, 0.0, 0.0, 1.0), 0.0, 1), 1.0)
    assert (planned.part_id, planned.label) == (part_id, label)
    check(write_script(planned), STAGE, planned.reference, AllowConfig())


def test_a_label_that_no_script_may_spell_is_refused_before_anybody_is_asked(folder, tmp_path):
    with pytest.raises(InputError, match="label '__cup' has a word that begins with an underscore"):
        command.run(settings(folder, tmp_path / "out", object=folder / "mug.obj", label="__cup"))


def test_a_sheet_without_thickness_lies_on_the_desk(folder, tmp_path):
    (tmp_path / "envelope.obj").write_text("v 0 0 0\nv .22 0 0\nv .22 .11 0\nv 0 .11 0\nf 1 2 3\nf 1 3 4\n")
    command.run(settings(folder, tmp_path / "out", object=tmp_path / "envelope.obj", label="envelope"))
    part = geometric.read(tmp_path / "out/insert.usda").parts["envelope_7"]
    assert sorted(np.ptp(part.mesh.bounds, axis=0)) == pytest.approx([0.0, 0.11, 0.22], abs=1e-3)


def write_stage(path: Path, mesh: Mesh, unit: float = 1.0, counts: list[int] | None = None) -> Usd.Stage:
    """Write an object as a USD stage."""
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, unit)
    UsdGeom.SetStageUpAxis(stage, "Z")
    prim = UsdGeom.Mesh.Define(stage, "/object/shape")
    prim.CreatePointsAttr(mesh.vertices)
    prim.CreateFaceVertexIndicesAttr(mesh.faces.ravel())
    prim.CreateFaceVertexCountsAttr(counts or [3] * len(mesh.faces))
    stage.Save()
    return stage


def test_what_a_renderer_does_not_show_is_no_part_of_an_object(tmp_path):
    stage = write_stage(tmp_path / "cup.usda", block(0.08, 0.08, 0.1))
    for purpose, shown in (("guide", False), ("proxy", False), ("render", True)):
        prim = UsdGeom.Mesh.Define(stage, f"/object/{purpose}")
        mesh = block(1.0, 1.0, 1.0)
        prim.CreatePointsAttr(mesh.vertices)
        prim.CreateFaceVertexIndicesAttr(mesh.faces.ravel())
        prim.CreateFaceVertexCountsAttr([3] * len(mesh.faces))
        prim.CreatePurposeAttr(purpose)
        stage.Save()
        found = read_object(tmp_path / "cup.usda", ObjectConfig(20_000, 7.0))
        assert (np.ptp(found.mesh.bounds, axis=0).max() > 0.5) == shown, purpose


def test_a_damaged_stage_is_named_and_a_unit_of_zero_is_none(tmp_path):
    mesh, read = block(0.1, 0.1, 0.1), ObjectConfig(20_000, 7.0)
    write_stage(tmp_path / "zero.usda", mesh, unit=0.0)
    assert read_object(tmp_path / "zero.usda", read).unit is None
    write_stage(tmp_path / "short.usda", mesh, counts=[3] * (len(mesh.faces) + 1))
    write_stage(tmp_path / "below.usda", mesh, counts=[-3, 6, *[3] * (len(mesh.faces) - 1)])
    for name in ("short", "below"):
        with pytest.raises(InputError, match=f"{name}.usda: /object/shape: its faces have .* export it again"):
            read_object(tmp_path / f"{name}.usda", read)


@pytest.mark.parametrize("said", few(["Sorry, no.", "x" * 3_000_000, "{" * 100, '{"noun": "Tasse"}']))
def test_a_model_that_talks_rubbish_leaves_all_as_it_was(folder, tmp_path, monkeypatch, capsys, said):
    before = sorted((path, path.stat().st_mtime_ns) for path in folder.rglob("*"))
    # Other tests' libraries leave handlers behind that write to streams long closed.
    monkeypatch.setattr(logging.getLogger(), "handlers", [])
    with endpoint(message(said)) as there:
        monkeypatch.setenv("OPENAI_API_KEY", "secret-key")
        monkeypatch.setenv("OPENAI_BASE_URL", there.url)
        values = [f"stage={folder}/geometric.usd", f"object={folder}/mug.obj", "label=mug", f"out={tmp_path}/out"]
        assert cli.main(["insert", *values, "llm=chat"]) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()
    assert sorted((path, path.stat().st_mtime_ns) for path in folder.rglob("*")) == before


def answers(script: str):  # type: ignore[no-untyped-def]
    """Return a model's replies: those of the rules, but for the script."""

    def reply(request: dict) -> object:
        system, question = request["messages"][0]["content"], request["messages"][1]["content"]
        if system == prompts.PLAN:
            place = {"target": "desk_2", "surface": "horizontal", "relation": "on", "height": 0.74, "reason": ""}
            return message(json.dumps({"up": "+z", "front": "-y", "near": None, "choices": [place]}))
        if system == prompts.SCALE:
            return message(json.dumps({**vars(MUG)}))
        assert system == prompts.SCRIPT
        plan = json.loads(question.removeprefix("The plan: "))
        names = (plan["id"], plan["label"], plan["reference"])
        own = write_script(Placement(*names, tuple(plan["translate"]), tuple(plan["orient"]), plan["scale"]))
        tries = len(request["messages"])
        return message(f"```python\n{own}```" if tries > 2 else script + own)

    return reply


@pytest.mark.parametrize(("script", "refused"), few([("import os\n", 1), ("", 0), ("open('/etc/passwd')\n", 1)], 1))
def test_a_script_that_is_refused_goes_back_once(folder, tmp_path, monkeypatch, script, refused):
    with endpoint(answers(script)) as there:
        monkeypatch.setenv("OPENAI_API_KEY", "secret-key")
        monkeypatch.setenv("OPENAI_BASE_URL", there.url)
        record = mug(folder, tmp_path / "out", "llm=chat", "script=model")
    assert len(record["script"]["refusals"]) == refused
    assert record["total"]["calls"] == 3 + refused
    assert len(there.asked) == 3 + refused


def test_a_script_is_written_from_the_plan_and_not_paid_for(folder, tmp_path, monkeypatch):
    with endpoint(answers("import os\n")) as there:  # which would be refused
        monkeypatch.setenv("OPENAI_API_KEY", "secret-key")
        monkeypatch.setenv("OPENAI_BASE_URL", there.url)
        record = mug(folder, tmp_path / "out", "llm=chat")
    assert len(there.asked) == 2
    assert record["script"]["refusals"] == []
    assert set(record["script"]["active"]) >= {"landlock"}  # it is confined all the same


def test_what_nobody_can_place_is_said_with_every_reason(folder, tmp_path):
    write(block(40.0, 40.0, 30.0), folder / "box.obj")
    values = {"object": folder / "box.obj", "label": "cardboard box", "prompt": "on the keyboard"}
    with pytest.raises(InputError, match=r"no place for 'cardboard box': on keyboard_3: .*finds no place"):
        command.run(settings(folder, tmp_path / "out", **values))
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({}, "object=FILE and label=WORDS"),
        ({"object": "a.obj", "label": "a", "objects": "b.yaml"}, "both"),
        ({"objects": "none.yaml"}, "none.yaml"),
        ({"object": "none.obj", "label": "mug"}, "no such file"),
    ],
)
def test_what_is_missing_is_named(folder, tmp_path, values, said):
    with pytest.raises(InputError, match=said):
        command.run(settings(folder, tmp_path / "out", **values))


def test_the_baseline_puts_the_mug_somewhere_too(folder, tmp_path):
    with pytest.raises(InputError, match="give pose=paper"):
        mug(folder, tmp_path / "out", "surface=ransac")
    try:
        record = mug(folder, tmp_path / "out", "surface=ransac", "pose=paper")
    except InputError as error:
        assert "desk_2" in str(error)  # it found a place, and the mug did not stay there
    else:
        assert record["surface"]["method"] == "ransac"


@pytest.mark.parametrize(
    ("height", "longest", "stated", "metres"),
    [
        (9.5, 11.0, None, 0.01),  # centimetres
        (95.0, 110.0, None, 0.001),
        (3.8, 4.4, None, 0.0254),
        (0.095, 0.11, 0.01, 1.0),  # states centimetres, as exporters do, and is in metres
        (9.5, 11.0, 0.01, 0.01),
        (11.0, 11.0, None, 0.01),
    ],
)
def test_a_unit_that_fits_is_the_files(height, longest, stated, metres):
    assert fit_scale(MUG, height, longest, stated).scale == metres


def test_where_no_unit_fits_the_middle_of_the_ranges_is_taken():
    found = fit_scale(MUG, 0.85, 1.0, None)
    assert found.method == "range"
    assert 0.08 <= 0.85 * found.scale <= 0.12
    assert 0.09 <= found.scale <= 0.14
    same = fit_scale(MUG, 1.7, 2.0, None)
    assert same.scale == pytest.approx(found.scale / 2, rel=1e-5)


def test_a_thing_whose_file_is_askew_stands_as_it_comes_to_rest():
    turn = Rotation.from_euler("x", 9, degrees=True)
    box = block(8.0, 6.0, 4.0)
    askew = Mesh(turn.apply(box.vertices), box.faces)
    up = settled_axis(askew, np.array([0.0, 0.0, 1.0]))
    assert tilt_margins(askew)["+z"] == pytest.approx(math.atan2(3.0, 2.0) / (math.pi / 2), abs=0.02)
    assert up == pytest.approx(turn.apply([0.0, 0.0, 1.0]), abs=0.01)
    mesh = upright(ObjectFile(askew, None, None), "+z", "-y", 0.01)
    assert np.ptp(mesh.bounds, axis=0) == pytest.approx([0.06, 0.08, 0.04], abs=1e-3)
    assert mesh.bounds.mean(axis=0) == pytest.approx([0.0, 0.0, 0.02], abs=1e-3)


def test_a_table_stands_on_four_legs_and_better_upside_down():
    legs = [at(block(0.05, 0.05, 0.7), x, y, 0.0) for x in (-0.5, 0.5) for y in (-0.3, 0.3)]
    whole = [at(block(1.1, 0.7, 0.04), 0, 0, 0.7), *legs]
    faces = np.concatenate([mesh.faces + 8 * n for n, mesh in enumerate(whole)])
    stands = tilt_margins(Mesh(np.concatenate([mesh.vertices for mesh in whole]), faces))
    # By area the top weighs 1.684 m^2 at 0.72 m and the legs 0.58 m^2 at 0.35 m; the foot's edge is 0.325 m away.
    up = (1.684 * 0.72 + 0.58 * 0.35) / (1.684 + 0.58)
    assert stands["+z"] == pytest.approx(math.atan2(0.325, up) / (math.pi / 2), abs=0.01)
    assert stands["-z"] > stands["+z"] > stands["+x"]
    assert tilt_margins(block(1, 1, 1)) == dict.fromkeys(stands, 0.5)


def test_a_cup_is_hollow_at_its_mouth_and_a_table_upside_down_is_not():
    cup = trimesh.creation.revolve([[0, 0.1], [0.9, 0.1], [0.9, 2], [1, 2], [1, 0], [0, 0]], sections=32)
    found = concavities(Mesh(cup.vertices, cup.faces))
    # Its inner radius is 0.9 of the outer one.
    assert found == {"+x": 0.0, "-x": 0.0, "+y": 0.0, "-y": 0.0, "+z": 0.8, "-z": 0.0}
    legs = [at(block(0.05, 0.05, 0.7), x, y, 0.0) for x in (-0.5, 0.5) for y in (-0.3, 0.3)]
    assert concavities(merge([at(block(1.1, 0.7, 0.04), 0, 0, 0.7), *legs])) == dict.fromkeys(found, 0.0)


def test_slices_tell_where_a_bottle_has_its_neck():
    bottle = trimesh.creation.revolve([[0, 0], [1, 0], [1, 2.8], [0.4, 2.9], [0.4, 5], [0, 5]], sections=64)
    found = cross_sections(Mesh(bottle.vertices, bottle.faces))
    # A circle has pi / 4 of its square; the neck 0.4^2 of that.
    assert found["z"] == [0.8, 0.8, 0.8, 0.1, 0.1]
    assert found["x"] == pytest.approx(found["y"], abs=0.11)
    assert found["x"] == pytest.approx(found["x"][::-1], abs=0.11)


def test_the_description_has_supports_carriers_and_no_handles():
    pen = Part("pen", at(block(0.14, 0.01, 0.01), 0.8, 0.2, 0.741))
    room = Scene("room", {**scene().parts, "pen_7": pen})
    supports = describe.survey(room, settings(Path("."), Path("out")).placement.regions)
    described = describe.describe(room, supports)
    lines = {line["id"]: line for line in described}
    assert lines["keyboard_3"]["on"] == "desk_2"
    assert lines["drawer_6"]["opens"] == "slides"
    (top, *_) = lines["desk_2"]["supports"]
    assert (top["kind"], top["height"]) == ("horizontal", 0.74)
    # 1.2 x 0.6 m less the keyboard's 0.4 x 0.14 and the crate's 0.25 x 0.25.
    assert top["free"] == pytest.approx(0.6, abs=0.04)
    # Between the keyboard and the right edge: the crate is in the corner behind.
    assert 0.3 < top["circle"] < 0.6
    described = [json.loads(line) for line in describe.text(described).splitlines()]
    assert {"on": "desk_2", "things": ["pen_7"]} in described
    assert [line["opens"] for line in described if "opens" in line] == [{"drawer_6": "slides"}]
    assert not any("label" in line for line in described)
    numbers = json.dumps([line["center"] + line["size"] for line in lines.values() if "size" in line])
    assert all(len(number.partition(".")[2]) <= 2 for number in numbers.strip("[]").replace("], [", ", ").split(", "))


@pytest.mark.parametrize(
    ("label", "noun"),
    [
        ("Coffee Mug", "mug"),
        ("red_coffee_mug_v2", "mug"),
        ("keyborad", "keyboard"),
        ("Heinz ketchup", "condiment bottle"),
        ("Starbucks", "cup"),
        ("bottle of shampoo", "shampoo"),
        ("flux capacitor", None),
    ],
)
def test_the_table_knows_words_brands_and_slips(label, noun):
    entry = known(label)
    assert (entry.noun if entry else None) == noun


def test_the_table_is_sound():
    nouns = {entry.noun for entry in table()}
    assert len(nouns) == len(table()) > 200
    assert set(brands().values()) <= nouns
    for entry in table():
        assert 0 < entry.height[0] <= entry.height[1] <= 2.0, entry.noun
        assert 0 < entry.longest[0] <= entry.longest[1] <= 3.0, entry.noun
        assert entry.height[0] <= entry.longest[1] * 1.01, entry.noun
        assert {how for how, _ in entry.places} <= {"on", "in", "inside", "against", "hanging"}, entry.noun


def test_every_answer_of_the_rules_fits_the_schema_that_models_are_given():
    room = scene()
    supports = describe.survey(room, settings(Path("."), Path("out")).placement.regions)
    lines = describe.describe(room, supports)
    for entry in table():
        sides = [100 * math.sqrt(entry.longest[0] * entry.longest[1])] * 3
        facts = {"label": entry.noun, "sides": sides, "up": None, "feet": dict.fromkeys(prompts.AXIS["enum"], 1.0)}
        facts |= {"hollow": {}, "slices": {}, "format": "obj", "wish": "", "room": lines}
        found = checked(parse(rules(Request("plan", "", (), None, facts)).text, Plan), room)
        assert found.choices or "none of its usual places" in found.declined
        assert scale.checked_size(parse(rules(Request("scale", "", (), None, facts)).text, Size)).noun == entry.noun


def test_the_table_lays_down_what_fell_over_and_looks_elsewhere_for_what_did_not_fit():
    room = scene()
    lines = describe.describe(room, describe.survey(room, settings(Path("."), Path("out")).placement.regions))
    facts = {"label": "razor", "sides": [15.0, 2.0, 4.5], "up": None, "wish": "", "room": lines, "hollow": {}}
    facts |= {"feet": {"+x": 0.01, "+y": 0.7, "-z": 0.3}, "tried": [("desk_2", 0.74)], "tried_up": "+y"}

    def again(unstable: bool) -> dict:
        return json.loads(rules(Request("plan", "", (), None, {**facts, "unstable": unstable})).text)

    fell, full = again(unstable=True), again(unstable=False)
    assert fell["up"] == "-z"
    assert fell["choices"][0]["target"] == "desk_2"
    assert full["up"] == "+y"
    assert "desk_2" not in [choice["target"] for choice in full["choices"]]


@pytest.mark.parametrize(
    ("wish", "near", "target"),
    [
        ("put it next to the keyboard", "keyboard_3", "desk_2"),
        ("please place it on the desk near the crate", "crate_4", "desk_2"),
        ("onto the floor", None, "floor_1"),
        ("somewhere nice", None, None),
    ],
)
def test_wishes_are_read(wish, near, target):
    room = describe.RoomState(scene(), "", settings(Path("."), Path("out")).placement)
    places = wished(room, read_wish(wish, room.scene), hangs=False)
    assert places["near"] == near
    assert (places["choices"][0]["target"] if places["choices"] else None) == target


UNWORDS = ["a\nmug", "mug\x1b[2J", "mug \udce9", "m" * 201, "\u202emug", " "]


@pytest.mark.parametrize(
    ("values", "said"),
    [
        *(({"label": label}, "not printable or longer|label=WORDS") for label in UNWORDS),
        ({"label": "mug", "prompt": "near \udce9"}, "no UTF-8"),
        ({"label": "mug", "prompt": "x" * 3000}, "longer than 2000"),
        ({"label": "mug", "sandbox": "none"}, "cannot keep files, network, processes"),
        ({"label": "mug", "sandbox": "files"}, "cannot keep network, processes"),
    ],
)
def test_what_would_fail_in_the_end_is_refused_before_the_model_is_paid(folder, tmp_path, monkeypatch, values, said):
    layers = {"none": "sandbox.layers=[]", "files": "sandbox.layers=[landlock]"}
    options = [layers[values.pop("sandbox")]] if "sandbox" in values else []
    with endpoint(answers("")) as there:
        monkeypatch.setenv("OPENAI_API_KEY", "secret-key")
        monkeypatch.setenv("OPENAI_BASE_URL", there.url)
        with pytest.raises(InputError, match=said):
            command.run(settings(folder, tmp_path / "out", "llm=chat", *options, object=folder / "mug.obj", **values))
    assert not there.asked


@pytest.mark.slow
def test_what_an_endpoint_says_reaches_the_terminal_without_control_characters(folder, tmp_path, monkeypatch, capsys):
    words = "\x1b[31mred\x07 \x9b2J a\u202eb \r\x08\x7f end"
    monkeypatch.setattr(logging.getLogger(), "handlers", [])
    values = [f"stage={folder}/geometric.usd", f"object={folder}/mug.obj", "label=mug", f"out={tmp_path}/out"]
    for reply in (failure(404, f"no {words} model"), message(f"no {words} plan"), Said(words.encode())):
        with endpoint(reply) as there:
            monkeypatch.setenv("OPENAI_API_KEY", "secret-key")
            monkeypatch.setenv("OPENAI_BASE_URL", there.url)
            assert cli.main(["insert", *values, "llm=chat", "llm.attempts=0"]) == 2
        said = capsys.readouterr().err
        assert len(said.splitlines()) == 1 and said.removesuffix("\n").isprintable()


@pytest.mark.parametrize(
    "text",
    [
        "[" * 20000,
        "a: &a [x,x]\nb: &b [*a,*a]\n",
        "- {object: mug.obj}",
        "- {object: [a], label: mug}",
        "- {object: mug.obj, label: {a: b}}",
        "- {object: mug.obj, label: 2020-01-01}",
        "mug.obj",
        "- 5",
        "- !!python/object:os.system {}",
        "\xff\xfe",
    ],
)
def test_a_list_of_something_else_is_one_line(folder, tmp_path, text):
    (tmp_path / "list.yaml").write_bytes(text.encode("latin-1"))
    with pytest.raises(InputError, match="not a list of"):
        command.run(settings(folder, tmp_path / "out", objects=tmp_path / "list.yaml"))


def test_a_list_of_aliases_of_aliases_is_refused_at_once(folder, tmp_path):
    lines = ["- &a0 {object: x, label: x}"] + [f"- &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]" for k in range(1, 12)]
    (tmp_path / "list.yaml").write_text("\n".join([*lines, "- {object: *a11, label: mug}"]))
    with pytest.raises(InputError, match="not a list of"):
        command.run(settings(folder, tmp_path / "out", objects=tmp_path / "list.yaml"))
    (tmp_path / "list.yaml").write_text("\n".join(["- object: mug.obj", "  label: &a [x, x]"][:1] + ["  label: *a"]))
    with pytest.raises(InputError, match="not a list of"):
        command.run(settings(folder, tmp_path / "out", objects=tmp_path / "list.yaml"))
