"""NVIDIA's SimReady Foundation: its published rules, run over a stage by its own validator."""

from __future__ import annotations

import functools
import importlib.util
import logging
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from s2a.certify.check import Check

INSTALL = "pip install 's2a[simready]'"


@dataclass(frozen=True)
class FoundationConfig:
    """What is asked of SimReady.

    Attributes:
        profile: whose features are asked.
        version: of the profile.
        required: features that must pass; the others of the profile are reported.
    """

    profile: str
    version: str
    required: tuple[str, ...]


def foundation(path: Path, config: FoundationConfig) -> list[Check]:
    """Return one check a feature of the profile; a single one that was not run where the validator is not installed."""
    if importlib.util.find_spec("simready") is None:
        text = "the package simready-validate is not installed"
        return [Check("simready", "skipped", message=text, remedy=INSTALL)]
    with _silent():
        validate = _validator()
        asked = validate.AssetValidationConfig(str(path), config.profile, config.version)
        result = validate.validate_asset(asked)
    if result is None:
        text = f"no profile {config.profile} {config.version} in the installed simready-foundation-tier-core"
        return [Check("simready", "skipped", message=text, remedy=INSTALL)]
    issues = [*result.issues, *result.soft_issues]
    features = sorted(result.features_summary.items(), key=lambda item: (item[0] not in config.required, item[0]))
    return [_check(name, summary, issues, name in config.required) for name, summary in features]


@functools.cache
def _validator() -> Any:
    """Import the validator and load the installed rules, which takes seconds."""
    import simready.validate as validate

    validate.initialize(rules_and_requirements_paths=[], features_paths=[], profiles_paths=[])
    return validate


def _check(name: str, summary: dict[str, Any], issues: list[Any], required: bool) -> Check:
    """Return the check of one feature; it names the broken rules and the first prim that breaks one."""
    title = f"simready:{name}"
    if summary["passed"]:
        return Check(title, "pass" if required else "info", 0.0, 0.0, "rules", message="passed")
    broken = f"{summary.get('failing requirements', '')}{summary.get('optional requirements', '')}"
    own = [issue for issue in issues if issue.requirement and f"'{issue.requirement.code}'" in broken]
    codes = sorted({str(issue.requirement.code).removeprefix("com.nvidia.") for issue in own})
    first = " ".join(str(own[0].message).split())[:200] if own else broken
    prim = str(getattr(own[0].at, "path", "")) if own else ""
    message = f"not passed: {', '.join(codes)}: {first}"
    remedy = "see the rule in NVIDIA's SimReady Foundation" if required else ""
    return Check(title, "fail" if required else "info", float(len(codes)), 0.0, "rules", prim, message, remedy)


@contextmanager
def _silent() -> Iterator[None]:
    """Keep the validator's log, which repeats what it returns, off the terminal."""
    before = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    try:
        yield
    finally:
        logging.disable(before)
