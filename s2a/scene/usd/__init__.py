"""USD in and out: the descriptive, the geometric and the simulation-ready flavour of a scene.

All stages measure in metres and kilograms, z up. Points lie in scene coordinates; no transform moves them.
"""

import newton_usd_schemas  # noqa: F401  (its schemas are known only if it is imported before the first use of any schema)
