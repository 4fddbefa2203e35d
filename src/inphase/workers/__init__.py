"""Independent work in this process, in several, or on a cluster: the same results from each, told as they come."""

from inphase.workers.cluster import check_address, local_cluster
from inphase.workers.team import Run, Team, workers

__all__ = ["Run", "Team", "check_address", "local_cluster", "workers"]
