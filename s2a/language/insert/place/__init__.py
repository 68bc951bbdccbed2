"""Where an object goes: supports, candidates, poses, fit."""
