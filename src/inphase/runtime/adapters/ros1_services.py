"""ROS 1 services beside a live interaction: begin anew, and ask for the phase."""

from __future__ import annotations

from functools import partial
from typing import Any, Protocol, runtime_checkable

from inphase.errors import OptionError
from inphase.io.mcap_messages import estimate as estimate_text
from inphase.result import Estimate
from inphase.runtime.adapters.ros1_node import join_ros, leave, service_class, within

TRIGGER = "std_srvs/Trigger"


@runtime_checkable
class Interaction(Protocol):
    """What a loop offers to all threads."""

    @property
    def estimate(self) -> Estimate | None:
        """The latest."""
        ...

    def reset(self) -> None:
        """Ask for a new interaction at the next cycle."""
        ...


class Ros1Services:
    """Two `std_srvs/Trigger`: <namespace>/reset begins a new interaction, <namespace>/phase tells the estimate.

    The message of phase is JSON with the fields of an `Estimate`, its status by name; without one it has no success.
    Raises OptionError where ROS is not installed.
    """

    def __init__(self, loop: Interaction, namespace: str = "inphase") -> None:
        self._loop, self._namespace = loop, namespace.rstrip("/")
        self._trigger = service_class(TRIGGER)
        self._services: list[Any] = []

    def start(self) -> None:
        """Offer them; raises OptionError where no master answers, or this process offers them already."""
        self.stop()
        ros = join_ros()
        for name, answer in (("reset", self._reset), ("phase", self._phase)):
            service = f"{self._namespace}/{name}"
            try:
                made = within(service, partial(ros.Service, service, self._trigger, answer))
            except OptionError:
                self.stop()
                raise
            self._services.append(made)

    def stop(self) -> None:
        """Offer them no more."""
        services, self._services = self._services, []
        leave(*(service.shutdown for service in services))

    def _reset(self, _: Any) -> Any:
        self._loop.reset()
        return self._trigger._response_class(True, "a new interaction begins with the next cycle")

    def _phase(self, _: Any) -> Any:
        estimate = self._loop.estimate
        if estimate is None:
            return self._trigger._response_class(False, "nothing was observed yet")
        return self._trigger._response_class(True, estimate_text(estimate))
