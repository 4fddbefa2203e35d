"""Look recordings over and say what is wrong, where and when; nothing is changed or rejected."""

from inphase.preprocess.checks.across import check_episodes
from inphase.preprocess.checks.episode import check, check_episode
from inphase.preprocess.checks.finding import EVERY_EPISODE, Finding, FindingKind

__all__ = ["EVERY_EPISODE", "Finding", "FindingKind", "check", "check_episode", "check_episodes"]
