"""A sentence -> skills of the planner: planned by a language model or by rules, checked against the room, executed, verified."""
