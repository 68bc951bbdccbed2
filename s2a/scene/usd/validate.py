"""USD's own rules: everything that usd-core can check about a stage."""

from __future__ import annotations

from pathlib import Path

from pxr import Usd, UsdValidation

from s2a.scene.usd.stage import open_stage

SERIOUS = (UsdValidation.ValidationErrorType.Error, UsdValidation.ValidationErrorType.Warn)


def problems(path: Path) -> list[str]:
    """Run all validators that usd-core ships (core, geometry, physics, shading ...) over a stage.

    Returns:
        One line for each error or warning, with the rule's name; empty where the stage is sound.

    Raises:
        InputError: the file is not a stage in metres with z up and the default prim `/scene`.
    """
    return broken_rules(open_stage(path))


def broken_rules(stage: Usd.Stage) -> list[str]:
    """Run all validators over an open stage of any kind; one line for each error or warning."""
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    found = UsdValidation.ValidationContext(validators).Validate(stage)
    return [" ".join(error.GetErrorAsString().split()) for error in found if error.GetType() in SERIOUS]
