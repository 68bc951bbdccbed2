"""The insertion of one object in two steps, planning and fixing, with its record."""

from __future__ import annotations

from s2a.core.errors import InputError
from s2a.language.insert.context import InsertContext, Inserted, ObjectRequest
from s2a.language.insert.pipeline import Planned, fixed, planned
from s2a.language.insert.review import reviewed
from s2a.language.insert.room_state import RoomState
from s2a.language.insert.settings import InsertSettings
from s2a.language.insert.stability import drop_check
from s2a.language.llm.ask import Model
from s2a.language.llm.usage_log import Record, UsageLog


class Attempt:
    """An insertion.

    Attributes:
        problem: why it failed; empty while it did not.
    """

    def __init__(self, room: RoomState, request: ObjectRequest, model: Model, settings: InsertSettings) -> None:
        self._usage, self._request, self._settings = UsageLog(settings.llm.prices), request, settings
        self._record: Record = {"object": str(request.file), "label": request.label, "hint": request.hint}
        check = drop_check(settings.hulls, settings.placement.drop_test)
        self._context = InsertContext(room, model, settings.pipeline, check, self._usage, self._record)
        self._planned: Planned | None = None
        self.problem = ""

    @property
    def footprint(self) -> float:
        """Area that the object takes [m^2]; 0 if its planning failed."""
        return self._planned.footprint if self._planned else 0.0

    def plan(self) -> None:
        """Plan its place."""
        try:
            self._planned = planned(self._context, self._request)
        except InputError as error:
            self.problem = str(error)

    def fix(self) -> Inserted | None:
        """Find its pose in the room as it is now; None if that fails, or its planning did."""
        if self._planned is None:
            return None
        try:
            inserted = fixed(self._context, self._planned)
            if self._settings.review and not self._context.config.rules:
                inserted = reviewed(self._context, self._planned, inserted, self._settings.camera)
        except InputError as error:
            self.problem = str(error)
            return None
        self._record["id"] = inserted.placement.part_id
        return inserted

    def finished(self) -> Record:
        """Return the record: results by step, the model's answers, and `problem`, which says why it failed."""
        about = {"problem": self.problem, "answers": self._usage.entries, "total": self._usage.total()}
        return self._record | about


def attempt(
    room: RoomState, request: ObjectRequest, model: Model, settings: InsertSettings
) -> tuple[Inserted | None, Record]:
    """Insert an object; return it, or None, and its record, whose `problem` says why it failed."""
    one = Attempt(room, request, model, settings)
    one.plan()
    return one.fix(), one.finished()
