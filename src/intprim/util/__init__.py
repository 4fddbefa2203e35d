"""Pictures of interactions, and the analysis files that tell what a filter believed at every step (4.2.8, 4.2.9)."""

from intprim.util import visualization
from intprim.util.stat_collector import StatCollector

__all__ = ["StatCollector", "visualization"]
