"""The page on which a scan is annotated."""

from s2a.annotate.page.serve import served as served
