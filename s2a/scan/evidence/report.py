"""Findings as text, one a line, and as JSON."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

from s2a.scan.evidence.finding import Finding


def doubtful(findings: Sequence[Finding]) -> list[Finding]:
    """Return the findings that fail, and then those that warn."""
    return [f for verdict in ("fail", "warn") for f in findings if f.verdict == verdict]


def failed(findings: Sequence[Finding]) -> bool:
    """Return True if a finding contradicts the annotation."""
    return any(finding.verdict == "fail" for finding in findings)


def text(findings: Sequence[Finding]) -> str:
    """Return what fails and what warns, a line each, and how many of each verdict there are."""
    lines = [f"  {finding.verdict} {finding.check}: {finding}" for finding in doubtful(findings)]
    counts = {verdict: sum(f.verdict == verdict for f in findings) for verdict in ("fail", "warn", "pass", "unknown")}
    return "\n".join([*lines, "  " + ", ".join(f"{count} {verdict}" for verdict, count in counts.items() if count)])


def to_json(findings: Sequence[Finding], **further: Any) -> str:
    """Return findings as JSON, after further values; NaN and infinity, which JSON lacks, become null."""
    rows = [{key: _plain(value) for key, value in dataclasses.asdict(finding).items()} for finding in findings]
    return json.dumps({"passed": not failed(findings), **_plain(further), "findings": rows}, indent=1) + "\n"


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
