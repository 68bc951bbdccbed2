"""Prompts for models: a system prompt a step, its JSON schema, the question, and the script of an insertion."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pxr import Sdf

from s2a.language.ask import object_schema
from s2a.language.sandbox.diff import ORIENTATION, POSITION, TAXONOMY, Placement
from s2a.language.sandbox.jail import STAGE, Sandbox
from s2a.language.sandbox.policy import check

TEMPLATE = """\
from pxr import Gf, Sdf, Usd, UsdGeom, UsdSemantics

stage = Usd.Stage.Open({stage!r})
xform = UsdGeom.Xform.Define(stage, {path!r})
prim = xform.GetPrim()
prim.GetReferences().AddReference({reference!r})
xform.AddTranslateOp().Set(Gf.Vec3d({x!r}, {y!r}, {z!r}))
xform.AddOrientOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Quatd({qw!r}, {qx!r}, {qy!r}, {qz!r}))
xform.AddScaleOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Vec3d({scale!r}, {scale!r}, {scale!r}))
prim.CreateAttribute("s2a:partId", Sdf.ValueTypeNames.String).Set({part_id!r})
prim.CreateAttribute("s2a:label", Sdf.ValueTypeNames.String).Set({label!r})
UsdSemantics.LabelsAPI.Apply(prim, {taxonomy!r}).CreateLabelsAttr([{label!r}])
stage.Save()
"""


@dataclass(frozen=True)
class ScriptResult:
    """Result of a script."""

    # `/scene` with the new prim, as the script wrote it; `s2a.language.insert.pipeline.write` puts it over a
    # stage
    layer: Sdf.Layer
    # plain values for the JSON record: the active sandbox layers, what they left exposed, seconds, the script
    record: dict[str, Any]


def run_sandboxed(sandbox: Sandbox, text: str, plan: Placement) -> ScriptResult:
    """Check a script, run it in the sandbox, and compare the saved stage with the plan.

    The script finds the stage as `scene.usda` in its current folder, and as `STAGE` and `OBJECT` that name and the path of
    the object's file.

    Raises:
        PolicyViolation: its text is not allowed, it failed, or its result differs from the plan.
        InputError: the system cannot confine an untrusted script.
    """
    check(text, STAGE, plan.reference, sandbox.config.allow)
    run = sandbox.run(text, {"STAGE": STAGE, "OBJECT": plan.reference})
    layer = sandbox.compare(run.saved, plan)
    return ScriptResult(
        layer,
        {"active": list(run.active), "exposed": list(run.exposed), "seconds": round(run.seconds, 3), "script": text},
    )


def write_script(plan: Placement) -> str:
    """Return the reference script: run without a model, and the example in the prompt."""
    (x, y, z), (qx, qy, qz, qw) = plan.position, plan.orientation
    return TEMPLATE.format(
        stage=STAGE,
        path=f"/scene/{plan.part_id}",
        reference=plan.reference,
        part_id=plan.part_id,
        label=plan.label,
        taxonomy=TAXONOMY,
        scale=plan.scale,
        **{"x": x, "y": y, "z": z, "qx": qx, "qy": qy, "qz": qz, "qw": qw},
    )


PLAN = """\
You furnish scanned rooms. You are given a room and an object, and say where in the room people would put the object, and
how they would turn it.

The room comes as JSON, a line a part. Lengths are in metres, z is up, the floor is at about 0.
- id; label, where the id does not say it; part_of: what it belongs to; on: what it stands on; opens: its doors and drawers.
- center and size of its upright box, which may be turned about z.
- supports: level surfaces that can carry things, each a list: kind, height above the floor, free area in m^2, diameter of the
  largest free circle, free height above it. Kinds: "horizontal" is a top, "inside" is a compartment with something of the
  same part above it, "basin" is surrounded by a rim: a sink, a tub, a tray.
- along: of a wall, what stands or hangs there, in order; free: widths of the gaps between that at eye level, the widest first.
- Lines with "things" have the ids of small things, and what they stand on, if that is known.
Things can hang on the upright sides of walls and furniture.

The object comes with its label, and
- sides: of its mesh along the file's x, y and z, in an unknown unit;
- format of the file, and stated_up: the up axis that it states, or null. Objects are often turned otherwise than that, or than
  is the habit of the format (obj and glb +y, stl and ply +z);
- feet: how firmly it stands with an axis upwards: how far it could be tilted before it falls, as a share of a right angle (a
  cube 0.5, a plate lying flat almost 1); on axes that are not listed it cannot stand;
- hollow: seen from the end at which an axis points, the share of the outline that is a deep hollow with walls all around: a mug
  has it at its mouth. Ends that are not listed have none;
- slices: along each axis, from its negative to its positive end, the share of the box's cross-section that five slices span:
  "y":[0.8,0.8,0.8,0.4,0.1] is like a bottle with its neck at +y;
- colours: how much the colours seen from an axis differ, 0 for a plain side: pictures, books and packages have their print in
  front, and plain backs. Left out where the file has no colours.

Answer with one JSON object:
- up: the axis of the file that points up once the object is in its place ("+x", "-x", "+y", "-y", "+z", "-z"). It is put down
  and let go, and nothing holds it: take the way in which people keep such a thing, and in which it stands (feet 0.05 or
  more); if feet do not allow that way, take the nearest one that they allow. What holds something has its mouth up. Flat
  things lie unless they hang.
- front: the axis along which its front looks, across up. If nothing tells: with +z up most files have their front at -y, with
  +y up at +z. What hangs on a wall has its back to the wall: its front is then its thin axis, and up is across that,
  whatever feet say.
- near: id of a part that it should be beside, or null. Set it if there is a wish for it or if things obviously go together.
- choices: three places, best first (fewer only if there are no more), each with
  - target: an id from the room, exactly as given, of what carries the object: the desk, not a thing on the desk;
  - surface: "horizontal" (a top or a basin), "inside" (a compartment), or "vertical" (a wall or an upright side);
  - relation: "on" a top, "in" a basin or a compartment, "against" (on a horizontal surface, with its back to what stands or
    rises there: furniture on a floor before a wall), "hanging" (only on a vertical surface);
  - height: the height of the support that you mean, as listed, or null; of what hangs, that of its middle, or null for eye level;
  - reason: in a few words.
- place: where it goes on these, a list, empty where it does not matter: each {"relation","of"}; relation is "left", "right",
  "front", "behind", "above" (of is one id of a thing; left and right as seen by who stands before it), "between" (of is two
  ids), "back edge", "front edge", "corner" or "middle" (of is one id of what carries it). It is held to where there is room.
- declined: "" or, if nothing in this room suits or the wish cannot be met here, why; choices are then empty.
The object must fit with its real size, which you know: look at the free circle and the free height; what is longer than the
circle may still fit along a narrow surface. Doors and drawers must stay free to open, and carry nothing. Keep small things
off the floor, and do not pile things on small or unsteady ones. A wish, if there is one, comes first: all choices must
honour it. Labels may be brands or rare words: think of what the thing is.

Example. Object {"label":"coffee mug","sides":[12.1,9.4,8.6],"format":"obj","stated_up":null,
"feet":{"+y":0.46,"-y":0.44,"+z":0.12,"-z":0.12},"hollow":{"+y":0.7},
"slices":{"x":[0.2,0.8,0.9,0.8,0.4],"y":[0.7,0.8,0.8,0.8,0.7],"z":[0.4,0.9,0.9,0.9,0.4]}}
in a room with desk_4, shelf_9, and keyboard_6 on the desk:
{"up":"+y","front":"+z","near":"keyboard_6","choices":[
{"target":"desk_4","surface":"horizontal","relation":"on","height":0.74,"reason":"mugs stand on desks, within reach"},
{"target":"shelf_9","surface":"inside","relation":"in","height":1.1,"reason":"a free compartment at hand height"}],
"place":[{"relation":"right","of":["keyboard_6"]}],"declined":""}
Example. Object {"label":"bar of soap","sides":[9,6,3],"format":"usda","stated_up":"+z",
"feet":{"+z":0.63,"-z":0.63,"+y":0.24,"-y":0.24},"hollow":{},
"slices":{"x":[0.8,1.0,1.0,1.0,0.8],"y":[0.8,1.0,1.0,1.0,0.8],"z":[0.9,1.0,1.0,1.0,0.9]}}
in a bathroom with washbasin_2, whose supports are ["basin",0.72,0.1,0.3,1.9] and ["horizontal",0.85,0.2,0.13,1.8]:
{"up":"+z","front":"-y","near":null,"choices":[
{"target":"washbasin_2","surface":"horizontal","relation":"on","height":0.85,"reason":"soap lies on the rim of the basin"},
{"target":"washbasin_2","surface":"horizontal","relation":"in","height":0.72,"reason":"or in the basin"}],
"place":[],"declined":""}
Answer with the JSON object alone."""

SCALE = """\
You know how large things are. You are given an object that somebody wants to put into a scanned room, and say how large
it really is.

The object comes with its label; the sides of its mesh, and of these its height in its place and the longest, in the file's own
unknown unit; the metres in a unit that the file states (often wrong, or null); the support that it shall be put on: its free
area in m^2, the diameter of its largest free circle, its widest extent and the free room above it in metres; and things near
that place with their sizes in metres.

Answer with one JSON object:
- noun: the plain English word for what it is. Resolve brands and rare words first: "Nespresso Vertuo" is a coffee machine.
- height: [least, largest] height in metres of such things, turned as this one: its given height is along what will be up.
- longest: [least, largest] length in metres of their longest side, which may be the height.
- unit: the unit that the file is probably written in: "m", "cm", "mm", "in", "ft" or "unknown".
- reason: in a few words.
Give the range in which nine of ten such things lie, not wider, in metres. Mind the proportions: they tell which kind it is, and
what belongs to the mesh (a stand, a dish, a lid, an open lid). Longest over height should be about that of the given numbers.
It must fit the support, and the things around it.

Example. {"label":"Swingline 747","sides":[7.4,1.5,2.2],"height":2.2,"longest":7.4,"stated":null,"support":{"part":"desk"}}:
{"noun":"stapler","height":[0.04,0.07],"longest":[0.13,0.20],"unit":"in","reason":"7.4 x 1.5 x 2.2 inches is a full-size stapler"}
Answer with the JSON object alone."""

REVIEW = """\
An object was put into a scanned room by a program. You are given two images of it in its place, from afar and from near, with
the object in the middle, its label, its longest side in metres, and what carries it. Say whether it looks right: is it the right
way up, does its front face where it should, is its size plausible beside its neighbours, and would a person have put such a thing
there? Scans are coarse and have holes; judge the object alone, and not how the room was scanned. Small liberties of taste are
right: it is wrong if most people would move or turn it.

Answer with one JSON object:
- right: true or false;
- problem: "" or, if it is not right, what is wrong and what would be better, in one sentence: another support, another
  direction up, another front.
Answer with the JSON object alone."""

# What the example of a script carries out
EXAMPLE = Placement(
    "coffee_mug_41", "coffee mug", "objects/coffee_mug_41.usdc", (1.25371, 0.5, 0.74508), (0.0, 0.0, 0.6, 0.8), 0.01
)

SCRIPT = f"""\
You write short Python scripts for usd-core. A script adds one object to a stage, exactly as planned, and nothing else.

The stage is the file "scene.usda" in the current folder (also in the variable STAGE); open it, edit it, save it.
Define one Xform at /scene/<id>. Give it exactly one reference: to the object's file, written out as given (also in the
variable OBJECT), without a prim path. Give it three transform operations in this order: translate, orient, scale, in double
precision, with the given numbers copied digit by digit. The orientation is given as x, y, z, w; Gf.Quatd takes w first. The
scale is the same for all axes. Set the attributes s2a:partId and s2a:label, both String. Apply UsdSemantics.LabelsAPI with the
instance name "class" and set its labels to a list with the label. End with stage.Save().
Import nothing but Gf, Kind, Sdf, Tf, Usd, UsdGeom, UsdSemantics and Vt from pxr. Open no other file, touch no other prim, no
other attribute; no names with a leading underscore, no getattr, eval, exec or open. The script runs in a locked process and
its result is compared with the plan; what differs is refused.

Example. {{"id":"coffee_mug_41","label":"coffee mug","reference":"objects/coffee_mug_41.usdc",\
"translate":[1.25371,0.50000,0.74508],"orient":[0.0000000,0.0000000,0.6000000,0.8000000],"scale":0.01}}:
{write_script(EXAMPLE)}
Answer with the script alone, without explanations."""


# Of a room whose scan names some surfaces nothing; not in the system prompt, by which recorded answers are found
NAMELESS = """A last word of a support says what a surface without a name is like by its height, such as "table-like"; a part
without a name may have several pieces of furniture in it, and walls to hang things on.
"""
# Relations of a plan to things of the room
PLACES = ("left", "right", "front", "behind", "above", "between", "back edge", "front edge", "corner", "middle")
AXIS = {"type": "string", "enum": ["+x", "-x", "+y", "-y", "+z", "-z"]}
SPAN = {"type": "array", "items": {"type": "number"}, "description": "least and largest"}
TEXT = {"type": "string"}

PLAN_SCHEMA = object_schema(
    up=AXIS,
    front=AXIS,
    near={"type": ["string", "null"]},
    choices={
        "type": "array",
        "items": object_schema(
            target=TEXT,
            surface={"type": "string", "enum": ["horizontal", "vertical", "inside"]},
            relation={"type": "string", "enum": ["on", "in", "against", "hanging"]},
            height={"type": ["number", "null"]},
            reason=TEXT,
        ),
    },
    place={
        "type": "array",
        "items": object_schema(
            relation={"type": "string", "enum": list(PLACES)}, of={"type": "array", "items": {"type": "string"}}
        ),
    },
    declined=TEXT,
)

REVIEW_SCHEMA = object_schema(right={"type": "boolean"}, problem=TEXT)

SCALE_SCHEMA = object_schema(
    noun=TEXT,
    height=SPAN,
    longest=SPAN,
    unit={"type": "string", "enum": ["m", "cm", "mm", "in", "ft", "unknown"]},
    reason=TEXT,
)


def plan_question(facts: Mapping[str, Any], room: str) -> str:
    """Return the question of where an object belongs; ends on which it cannot stand, or that are closed, are left out."""
    wish = f"\nThe wish: {facts['wish']}" if facts.get("wish") else ""
    note = NAMELESS if any("like" in one for line in facts.get("room", ()) for one in line.get("supports", ())) else ""
    described = {"label": facts["label"], "sides": facts["sides"], "format": facts["format"], "stated_up": facts["up"]}
    described |= {name: {axis: share for axis, share in facts[name].items() if share} for name in ("feet", "hollow")}
    described |= {"slices": facts["slices"]}
    colours = facts.get("varied", {})
    described |= {"colours": colours} if any(colours.values()) else {}
    return f"The room:\n{room}\n{note}\nThe object: {_json(described)}{wish}"


def review_question(facts: Mapping[str, Any]) -> str:
    """Return the question whether an object looks right in its place; the image goes with it."""
    return f"The object: {_json(facts)}"


def scale_question(facts: Mapping[str, Any]) -> str:
    """Return the question of how large an object is."""
    names = ("label", "sides", "height", "longest", "stated", "support", "neighbours")
    return f"The object: {_json({name: facts[name] for name in names})}"


def script_question(plan: Placement) -> str:
    """Return the question for a script; as many digits as a plan has, also where they are zeros: recordings rely on that."""
    words = {"id": plan.part_id, "label": plan.label, "reference": plan.reference}
    translate = ",".join(f"{value:.{POSITION}f}" for value in plan.position)
    orient = ",".join(f"{value:.{ORIENTATION}f}" for value in plan.orientation)
    return f'The plan: {_json(words)[:-1]},"translate":[{translate}],"orient":[{orient}],"scale":{plan.scale}}}'


def _json(values: Mapping[str, Any]) -> str:
    return json.dumps(values, separators=(",", ":"), ensure_ascii=False)
