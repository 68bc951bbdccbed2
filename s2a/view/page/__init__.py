"""A scan or a stage as a page in the browser: its parts, a slider for every joint, layers to show and hide."""
