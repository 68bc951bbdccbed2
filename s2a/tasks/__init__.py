"""What robots do: one folder a task."""
