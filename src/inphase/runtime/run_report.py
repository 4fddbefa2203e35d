"""What a run was like: how long its stages took, what was lost, and how far the robot was behind."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass

from inphase.runtime.timing import Spread

REPORT = "report"  # the kind of event that holds one


@dataclass(frozen=True)
class RunReport:
    """The figures of a run.

    duration: [s]. cycles, of which overruns took longer than there was time. commands sent, and missed: left out since
    their time had passed. timings: by stage; "late" is how late a cycle began. samples: by sensor, how many met which
    fate. skipped: readings left out to catch up. late: readings that came after later ones had been observed.
    unrecorded: what is not in the recording, and why if it failed. lag: [s] the robot is behind; NaN if unknown.
    ended: why, and whether it stopped for a trouble.
    """

    duration: float
    cycles: int
    overruns: int
    commands: int
    missed: int
    timings: Mapping[str, Spread]
    samples: Mapping[str, Mapping[str, int]]
    skipped: int
    late: int
    unrecorded: int
    recorder_failure: str | None
    lag: float
    ended: str
    stopped: bool

    @property
    def as_json(self) -> str:
        """All of it, for a machine; what is not known is null."""
        content = asdict(self)
        content["lag"] = None if self.lag != self.lag else self.lag
        return json.dumps(content)

    @classmethod
    def of_json(cls, content: str) -> RunReport:
        """The report that `as_json` wrote; raises what a wrong entry raises."""
        told = json.loads(content)
        told["timings"] = {stage: Spread(**spread) for stage, spread in told["timings"].items()}
        told["lag"] = float("nan") if told["lag"] is None else float(told["lag"])
        return cls(**told)

    @property
    def lines(self) -> list[str]:
        """All of it, for a person."""
        lines = [
            f"{self.ended} after {self.duration:.1f} s: {self.cycles} cycles, {self.overruns} overruns, "
            f"{self.commands} commands, {self.missed} missed"
        ]
        lines += ["[ms]         p50      p99      max"]
        lines += [
            f"{stage:9s}" + "".join(f"{1e3 * value:9.3f}" for value in (spread.p50, spread.p99, spread.max))
            for stage, spread in self.timings.items()
            if spread.count
        ]
        for sensor, fates in self.samples.items():
            lines.append(f"{sensor}: " + (", ".join(f"{n} {fate}" for fate, n in fates.items()) or "nothing came"))
        if self.skipped or self.late:
            lines.append(f"{self.skipped} readings skipped to catch up, {self.late} taken for newer than they were")
        if self.unrecorded or self.recorder_failure:
            lines.append(f"{self.unrecorded} not recorded{self.recorder_failure and ': '}{self.recorder_failure or ''}")
        if self.lag == self.lag:
            lines.append(f"the robot was {1e3 * self.lag:.0f} ms behind what it was sent")
        return lines
