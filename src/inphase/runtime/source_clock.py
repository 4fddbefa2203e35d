"""What the clock of a device reads at a time of the loop's clock: its offset and its drift."""

from __future__ import annotations

from math import inf

from inphase.errors import OptionError

BUCKET = 0.5  # [s] of which the sample that came fastest is kept
WINDOW = 60.0  # [s] back to which the line is laid
SHORTEST = 5.0  # [s] before which a drift cannot be told from a delay that happened to grow
MOST_DRIFT = 0.002  # no clock is as wrong as that; what grows faster is a delay


class SourceClock:
    """The time of the loop as a line over the stamps of a device, laid under all that was received.

    A sample is received later than it was read, now more, now less, and never earlier. So the points (stamp, received)
    lie above the line that is sought, and those that came fastest nearly on it, whatever the other delays are: a mean
    or a regression would follow them. Of all lines below the points, this is the one closest to them in sum, which is
    the edge of their lower convex hull at the middle stamp (Moon, Skelly and Towsley 1999). The shortest delay of all
    cannot be told from an offset and counts as one. A delay that grows for good is no drift: the line never rises
    faster than a clock could be wrong (`MOST_DRIFT`), however long it lasts.

    shared: the device stamps with the loop's own clock, and nothing is to be found out. window: [s] looked back on.
    Raises OptionError for a window that is too short.
    """

    def __init__(self, shared: bool = False, window: float = WINDOW) -> None:
        if not window >= SHORTEST:
            raise OptionError(f"expected a window of at least {SHORTEST:g} s, got {window:g} s")
        self.shared = shared
        self._window = window
        self._origin: tuple[float, float] | None = (0.0, 0.0) if shared else None
        self._fastest: dict[int, tuple[float, float]] = {}  # by bucket: stamp and received since the origin
        self._rate, self._offset = 1.0, 0.0  # received = rate · stamp + offset, both since the origin
        self._ceiling = inf  # that offset at the highest rate, of all that ever came
        self._newest = 0.0

    def add(self, stamp: float, received: float) -> None:
        """Learn from one more sample."""
        if self.shared:
            return
        if self._origin is None:
            self._origin = stamp, received
        s, r = stamp - self._origin[0], received - self._origin[1]
        bucket = int(s // BUCKET)
        best = self._fastest.get(bucket)
        begun = best is None and bool(self._fastest)
        if best is None or r - self._rate * s < best[1] - self._rate * best[0]:
            self._fastest[bucket] = s, r
        self._newest = max(self._newest, s)
        self._ceiling = min(self._ceiling, r - (1 + MOST_DRIFT) * s)
        if begun:
            self._fit()
        else:
            self._offset = min(self._offset, r - self._rate * s)

    def time_of(self, stamp: float) -> float:
        """The time of the loop [s] at that stamp."""
        first, start = self._origin or (0.0, 0.0)
        return start + self._rate * (stamp - first) + self._offset

    def stamp_at(self, time: float) -> float:
        """What the device's clock reads at that time of the loop [s]."""
        first, start = self._origin or (0.0, 0.0)
        return first + (time - start - self._offset) / self._rate

    @property
    def drift(self) -> float:
        """Seconds that the device's clock gains in one of the loop's; negative where it loses."""
        return 1 / self._rate - 1

    @property
    def offset(self) -> float:
        """What the device's clock reads at the newest sample, less the time of the loop then [s]."""
        stamp = (self._origin or (0.0, 0.0))[0] + self._newest
        return stamp - self.time_of(stamp)

    def _fit(self) -> None:
        oldest = self._newest - self._window
        self._fastest = {bucket: point for bucket, point in self._fastest.items() if point[0] >= oldest}
        points = sorted(self._fastest.values())
        if points[-1][0] - points[0][0] >= SHORTEST:
            slope = _slope_below(points)
            self._rate = min(max(slope, 1 - MOST_DRIFT), 1 + MOST_DRIFT)
        highest = self._ceiling + (1 + MOST_DRIFT - self._rate) * self._newest
        self._offset = min(highest, *(r - self._rate * s for s, r in points))


def _slope_below(points: list[tuple[float, float]]) -> float:
    """The slope of the line below all points, sorted by the first number, that is closest to them in sum."""
    hull: list[tuple[float, float]] = []
    for x, y in points:
        while len(hull) > 1 and (hull[-1][0] - hull[-2][0]) * (y - hull[-2][1]) <= (hull[-1][1] - hull[-2][1]) * (
            x - hull[-2][0]
        ):
            hull.pop()
        hull.append((x, y))
    middle = sum(x for x, _ in points) / len(points)
    right = next(i for i, (x, _) in enumerate(hull) if x >= middle)
    (x0, y0), (x1, y1) = hull[right - 1], hull[right]
    return (y1 - y0) / (x1 - x0)
