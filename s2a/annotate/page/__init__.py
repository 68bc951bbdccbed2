"""The page on which a scan is annotated."""
