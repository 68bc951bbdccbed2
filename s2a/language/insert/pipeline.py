"""Insertion of one object: describe the room, plan, scale, find a pose, check its stability, author a script, review it."""

from __future__ import annotations

import copy
import re
import textwrap
import unicodedata
from collections.abc import Iterator
from functools import cache, partial

import numpy as np

from s2a.core.errors import InputError, encodable
from s2a.language.ask import Model, Record, Request, UsageLog, ValidationFeedback, ask, step, tokens, without_thoughts
from s2a.language.grammar import Wish
from s2a.language.insert import describe, prompts
from s2a.language.insert.describe import RoomState
from s2a.language.insert.fit import NoRoom, Pose
from s2a.language.insert.object_file import ObjectFile, colour_spread, read_object, upright
from s2a.language.insert.plan import FailedPlan, Plan, ScaleFit, Size, apart_from_likes, fit_scale, plan, size
from s2a.language.insert.poses import CandidatePose, Keep, PoseConfig, candidate_poses, facing_first
from s2a.language.insert.prompts import ScriptResult, run_sandboxed
from s2a.language.insert.review import reviewed
from s2a.language.insert.rules import write_scripts
from s2a.language.insert.settings import Inserted, InsertSettings, ObjectRequest
from s2a.language.insert.stability import StabilityCheck, drop_check, stable_pose
from s2a.language.insert.stable_pose import concavities, cross_sections, tilt_margins
from s2a.language.insert.wish import nowhere, wished
from s2a.language.insert.wish_check import RoomRelations, allowed, decline, objection, planned_place, read_wish, verdict
from s2a.language.sandbox.diff import Placement, check_label
from s2a.language.sandbox.jail import Sandbox
from s2a.language.sandbox.operations import PolicyViolation
from s2a.language.sandbox.policy import HIDDEN
from s2a.scan.labels import part_id
from s2a.scene.scene import Mesh, Part, Scene

# A block of code in Markdown
FENCE = re.compile(
    r"^[ \t>]*(?P<fence>`{3,}|~{3,})[ \t]*(?P<language>[\w.+-]*)[^\n`]*\n(?P<script>.*?)(?:^[ \t]*(?P=fence)[`~]*[ \t]*$|\Z)",
    re.DOTALL | re.MULTILINE,
)
MAX_HINT = 2000  # Letters of a placement hint
LANGUAGES = ("python", "python3", "py", "py3")


def check_words(label: str, hint: str) -> None:
    """Raise an InputError if a label or a placement hint can be in no script, file or request."""
    check_label(label)
    if HIDDEN.search(label):
        raise InputError(f"label {label!r} has a word that begins with an underscore, or two; use plain words")
    if encodable(hint) != hint or len(hint) > MAX_HINT:
        raise InputError(
            f"prompt {hint[:40]!r} is longer than {MAX_HINT} letters, or no UTF-8; say it in fewer, plain words"
        )


def placement(scene: Scene, label: str, pose: Pose, scale: float) -> Placement:
    """Return the placement for the script; the id is the label with the number after the highest in the scene."""
    numbers = [int(tail) for i in scene.parts if (tail := i.rpartition("_")[2]).isdecimal()]
    plain = unicodedata.normalize("NFKD", label.lower()).encode("ascii", "ignore").decode()
    # No leading and no double underscores: the policy forbids scripts to contain such names (s2a.language.sandbox.policy).
    words = "_".join(re.findall("[a-z0-9]+", plain))[:40].strip("_") or "object"
    name = part_id(words, max(numbers, default=0) + 1).lstrip("_")
    name = name if name[0].isalpha() else f"object_{name}"
    x, y, z = map(float, pose.position)  # the repr of NumPy's floats names their type
    qx, qy, qz, qw = map(float, pose.quaternion)
    return Placement(name, label, f"objects/{name}.usdc", (x, y, z), (qx, qy, qz, qw), float(scale))


def author(model: Model, sandbox: Sandbox, planned: Placement, usage: UsageLog, record: Record) -> ScriptResult:
    """Ask for a script and run it in the sandbox; a policy violation goes back to the model once.

    `record`: of the step; receives the violations, the script, the active sandbox layers and the seconds.

    Raises:
        InputError: the second script was rejected too, or the system cannot confine scripts.
    """
    facts = {"id": planned.part_id, "label": planned.label, "plan": planned}
    refusals: list[str] = record.setdefault("refusals", [])

    def accept(text: str) -> ScriptResult:
        try:
            return run_sandboxed(sandbox, bare(text), planned)
        except PolicyViolation as violation:
            refusals.append(str(violation))
            raise ValidationFeedback(f"{violation}. Write the script again, whole.") from violation

    request = Request("script", prompts.SCRIPT, (("user", prompts.script_question(planned)),), None, facts)
    result = ask(model, request, accept, 1, usage)
    record |= {name: value for name, value in result.record.items() if name != "seconds"}
    record["confined_seconds"] = result.record["seconds"]
    return result


def bare(text: str) -> str:
    """Return the script in an answer, without what the model thought, code fences and the text around them.

    Of several fences the last one that says python counts, else the last one. One that does not end goes on to the end.
    """
    text = without_thoughts(text).lstrip("\ufeff")
    fences = [(fence["language"].lower(), fence["script"]) for fence in FENCE.finditer(text)]
    if not fences:
        return text
    written = [script for language, script in fences if language in LANGUAGES]
    return textwrap.dedent(written[-1] if written else fences[-1][1])


class Attempt:
    """The insertion of one object: its place is planned, and fixed in the room as it is then.

    Attributes:
        record: results by step, filled also if a step fails.
        usage: log of the model's answers.
        error: why it failed: NoRoom where no candidate pose is free and stable; another InputError for a label that no script may
            contain, a file without an object, a hint that cannot be met, or no usable answer; None while it did not fail.
    """

    def __init__(
        self,
        room: RoomState,
        request: ObjectRequest,
        model: Model,
        settings: InsertSettings,
        check: StabilityCheck | None = None,
    ) -> None:
        """Begin.

        Args:
            room: the room; not changed.
            request: the object.
            model: language model, recording or rules.
            settings: of the insertion.
            check: test of an object at a candidate pose; None for the drop test of the settings.
        """
        self.usage = UsageLog(settings.llm.prices)
        self.error: InputError | None = None
        self.record: Record = {"object": str(request.file), "label": request.label, "hint": request.hint}
        self._room, self._request, self._model, self._settings = room, request, model, settings
        self._check = check or drop_check(settings.hulls, settings.placement.drop_test)
        self._plan: Plan | None = None

    @property
    def footprint(self) -> float:
        """Area that the object takes of its support [m^2]: big ones are placed before small ones; 0 if planning failed."""
        if self._plan is None:
            return 0.0
        sides = np.ptp(self._upright(self._plan, self._fit(self._plan).scale).bounds, axis=0)
        return float(sides[0] * sides[1])

    def plan(self) -> None:
        """Read the object, and ask where it goes and how large it is."""
        try:
            self._planned()
        except InputError as error:
            self.error = error

    def fix(self) -> Inserted | None:
        """Find its pose in the room as it is now, and author it; None if that fails, or its planning did."""
        if self._plan is None:
            return None
        try:
            inserted = self._fixed()
            if self._settings.review and not self._settings.by_rules:
                inserted = self._reviewed(inserted)
        except InputError as error:
            self.error = error
            return None
        self.record["id"] = inserted.placement.part_id
        return inserted

    def finished(self) -> Record:
        """Return the record: results by step, the model's answers, and `problem`, which says why it failed."""
        problem = str(self.error) if self.error else ""
        return self.record | {"problem": problem, "answers": self.usage.entries, "total": self.usage.total()}

    def _planned(self) -> None:
        room, request, settings, record = self._room, self._request, self._settings, self.record
        check_words(request.label, request.hint)
        self._file = read_object(request.file, settings.placement.object)
        self._wish = read_wish(request.hint, room.named)
        if settings.wish == "heed":
            decline(self._wish, request.hint, room.named, understood=not settings.by_rules)
        with step(record, "describe") as result:
            result |= {"parts": len(room.lines), "tokens": tokens(describe.text(room.lines))}
        with self._sandbox() as sandbox:
            sandbox.check_guarantees()  # before the model is asked: its answers may cost money
        self._facts = _facts(self._file, request, room.lines)
        if self._wish.relations:
            self._facts["wished"] = cache(partial(wished, room, self._wish))
            heeded = settings.wish == "heed" and settings.by_rules and settings.surface == "regions"
            if heeded and not any(self._facts["wished"](hangs)["choices"] for hangs in (False, True)):
                raise NoRoom(f"no place for {request.label!r}: {nowhere(room, self._wish)}")
        where = self._ask_plan(None)
        with step(record, "scale") as result:
            self._size = self._ask_size(where)
            result |= vars(self._size)
        self._plan = where

    def _fixed(self, failed: FailedPlan | None = None) -> Inserted:
        """Return the object in its place; by another plan, if one failed."""
        scene, record, request, settings = self._room.scene, self.record, self._request, self._settings
        where, object, scale, candidate = self._place(failed)
        moved = candidate.pose.moved(object)
        if request.hint:
            record["wish"] = verdict(self._understood(where), request.hint, self._room.named, moved)
        model = self._model if settings.script == "model" else write_scripts
        with self._sandbox() as sandbox, step(record, "script") as result:
            prim = placement(scene, request.label, candidate.pose, scale)
            script = author(model, sandbox, prim, self.usage, result)
        return Inserted(prim, candidate, Part(request.label, moved), self._upright(where, 1.0), script.layer, where)

    def _reviewed(self, inserted: Inserted) -> Inserted:
        """Return an insertion that a model finds right, else one by another plan, else the first one."""
        with step(self.record, "review") as result:
            review = reviewed(self._model, self._room.scene, inserted, self._settings, self.usage)
            result |= vars(review)
        if review.right:
            return inserted
        before = copy.deepcopy(self.record)
        reason = f"It was put there, and does not look right: {review.problem[:500]}"
        try:
            return self._fixed(FailedPlan(inserted.plan, reason, False))
        except InputError as error:
            self.record.clear()
            self.record.update(before)
            self.record["review"]["kept"] = str(error)
            return inserted

    def _sandbox(self) -> Sandbox:
        """Return a sandbox; scripts of the rules are trusted on systems that cannot confine them."""
        return Sandbox(self._room.geometry_free_text, self._settings.sandbox, self._settings.by_rules)

    def _understood(self, where: Plan) -> Wish:
        """Return the hint as it was parsed; as the plan understood it, where the parser understood nothing."""
        parsed = self._wish.relations or self._wish.missing or not self._request.hint
        return self._wish if parsed else planned_place(where)

    def _ask_plan(self, failed: FailedPlan | None) -> Plan:
        """Ask for a plan, or for another one after a plan without room."""
        room = self._room
        with step(self.record, "plan again" if failed else "plan") as result:
            text, retries = describe.text(room.lines), self._settings.retries
            answer = plan(self._model, room.scene, self._facts, text, retries, self.usage, failed)
            result |= answer.said()
            if answer.declined and not failed:
                raise self._declined(answer, "; name one with prompt=...")
        return answer

    def _declined(self, answer: Plan, remedy: str = "") -> NoRoom:
        return NoRoom(f"no place for {self._request.label!r}: {answer.declined[:300]}{remedy}")

    def _ask_size(self, where: Plan) -> Size:
        """Ask for the size of the object."""
        height, longest = self._extents(where)
        question = {"label": self._facts["label"], "sides": self._facts["sides"], "stated": self._file.unit}
        question |= {"height": float(f"{height:.3g}"), "longest": float(f"{longest:.3g}")}
        question |= describe.context_of(self._room.scene, self._room.supports, where, self._settings.neighbours)
        return size(self._model, question, self._settings.retries, self.usage)

    def _extents(self, where: Plan) -> tuple[float, float]:
        """Return the object's height and longest side in the file's unit."""
        sides = np.ptp(self._file.mesh.bounds, axis=0)
        return float(sides["xyz".index(where.up[1])]), float(sides.max())

    def _fit(self, where: Plan) -> ScaleFit:
        return fit_scale(self._size, *self._extents(where), self._file.unit)

    def _upright(self, where: Plan, scale: float) -> Mesh:
        return upright(self._file, where.up, where.front, scale, where.hangs)

    def _place(self, failed: FailedPlan | None) -> tuple[Plan, Mesh, float, CandidatePose]:
        """Find a pose; ask for another plan while there is no room, or one only where an earlier plan failed.

        Returns:
            The plan, the object upright and to scale [m], its scale (metres per unit of the file), and the candidate pose.
        """
        where = self._ask_plan(failed) if failed else self._plan
        assert where is not None
        if where.declined:
            raise self._declined(where)
        for left in reversed(range(1 if failed else self._settings.plans)):
            try:
                lines = [] if self._request.hint else self._room.lines
                where = apart_from_likes(where, self._request.label, lines, last=not left)
                fit = self._fit(where)
                object = self._upright(where, fit.scale)
                sides = [round(float(side), 4) for side in np.ptp(object.bounds, axis=0)]
                self.record["scale"] |= vars(fit) | {"size": sides}
                return where, object, fit.scale, self._stable_candidate(object, where, anyhow=not left)
            except NoRoom as full:
                if not left:
                    raise
                where = self._ask_plan(FailedPlan(where, full.summary, full.unstable))
                if where.declined:
                    reason = f"{full.summary}; asked again: {where.declined[:300]}"
                    raise NoRoom(
                        reason, unstable=full.unstable, remedy="; name another place with prompt=..."
                    ) from full
        raise AssertionError("plans is at least 1")

    def _stable_candidate(self, object: Mesh, where: Plan, anyhow: bool) -> CandidatePose:
        """Return the first candidate pose, in the order of the plan, at which the object stays.

        `anyhow`: turn a large object's side or back to the room where there is no other place.

        Raises:
            NoRoom: there is none.
        """
        room, config, record = self._room, self._settings.placement, self.record
        unstable = False
        keeps: dict[Wish, Keep | None] = {}
        related = RoomRelations(room.named)

        def check(candidate: CandidatePose) -> Record:
            nonlocal unstable
            with step(record, "verify") as result:
                result.pop("rest", None)  # of earlier candidates
                outcome = self._check(object, candidate, room.scene)
                result |= outcome
            unstable = unstable or outcome.get("unstable", False)
            return outcome

        for wish, pose in self._searches(object, where, anyhow):
            if pose is config.pose and pose.pose == "search" and unstable:
                continue  # it would fall over however it is turned
            reasons: list[str] = []
            if wish not in keeps:
                keeps[wish] = allowed(wish, related, object)
            poses = candidate_poses(room, object, where, config, pose, reasons, keeps[wish])
            unheeded = partial(_unheeded, related, object, wish)
            with step(record, "pose") as result:
                candidate = stable_pose(room, object, poses, check, unheeded, config.pose, reasons)
                if candidate is not None:
                    result |= {name: np.asarray(value).tolist() for name, value in vars(candidate.pose).items()}
                    record["surface"] = {**candidate.surface, "reason": candidate.choice.reason, "passed over": reasons}
                    return candidate
        record["surface"] = {"passed over": reasons}
        summary = f"no place for {record['label']!r}: {'; '.join(reasons)}"
        raise NoRoom(summary, unstable=unstable, remedy="; name another place with prompt=...")

    def _searches(self, object: Mesh, where: Plan, anyhow: bool) -> Iterator[tuple[Wish, PoseConfig]]:
        """Yield what is searched for: squarely first, and first where the plan has it; other turns before giving up a hint."""
        hint = self._understood(where)
        preferred = Wish((*hint.relations, *planned_place(where).relations))
        for wishes in ((preferred, hint), (Wish(),))[: 2 if self._settings.wish == "prefer" else 1]:
            for pose in facing_first(object, self._settings.placement.pose, anyhow):
                for wish in dict.fromkeys(wishes):
                    yield wish, pose


def _unheeded(related: RoomRelations, object: Mesh, wish: Wish, candidate: CandidatePose) -> str:
    """Return the relation of a hint that a candidate does not have, as a clause; empty if it has all."""
    return objection(related, wish, candidate.pose.moved(object)) if wish.relations else ""


def _facts(file: ObjectFile, request: ObjectRequest, lines: list[Record]) -> Record:
    """Return the facts about an object that go into the model's questions."""
    return {
        "label": request.label,
        "sides": [float(f"{side:.3g}") for side in np.ptp(file.mesh.bounds, axis=0)],
        "format": request.file.suffix.lower().lstrip("."),
        "up": file.up,
        "feet": tilt_margins(file.mesh),
        "hollow": concavities(file.mesh),
        "slices": cross_sections(file.mesh),
        "varied": colour_spread(file.mesh),
        "wish": request.hint,
        "room": lines,
    }


def attempt(
    room: RoomState, request: ObjectRequest, model: Model, settings: InsertSettings
) -> tuple[Inserted | None, Record]:
    """Insert an object; return it, or None, and its record, whose `problem` says why it failed."""
    one = Attempt(room, request, model, settings)
    one.plan()
    return one.fix(), one.finished()
