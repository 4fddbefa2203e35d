"""One trial in the world: the person acts, the robot is led or answers, and what sensors and encoders read is kept."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from experiments.cooperation.guide import led
from experiments.cooperation.people import SHIRTS
from experiments.cooperation.plan import Plan
from experiments.cooperation.posture import posture
from experiments.cooperation.sensors import SYNC, TICK, Moment, Sensors, hidden
from experiments.cooperation.world import HANDLE, HANDOVER, STEP, World

STEPS = round(TICK / STEP)
STIFF, DAMP, STRONG = 900.0, 45.0, 90.0  # of an arm that holds: [N/m], [Ns/m], [N] at most
TURN, TURN_DAMP = 0.6, 0.02  # [Nm/rad], [Nms/rad] of a hand around a thing
EAGER, AT_HAND = 0.5, 0.10  # [s], [m]: nobody lets a thing fall that is in their hand
LETS_GO = 0.15  # [s] within which a hand that lets go is where it was to be
WITHIN = 0.16  # [m] from the palm to the middle of a thing that it can take
Robot = Callable[[int, np.ndarray | None], tuple[np.ndarray, float]]


@dataclass(frozen=True, eq=False)
class Trial:
    """What was read at 30 Hz. values: (T, 74), the encoders last. hid: (T,) share of joints hidden. done: a success.

    waited: how long the person had to wait for the robot [s].
    """

    times: np.ndarray
    values: np.ndarray
    hid: np.ndarray
    done: bool
    says: dict[str, float]
    waited: float
    frames: list[np.ndarray]


class Hand:
    """A hand that holds a point of the thing as a spring of limited force would. at: in the thing's frame."""

    def __init__(self) -> None:
        self.at: np.ndarray | None = None
        self.turn: np.ndarray | None = None  # (3, 3) of the thing when it was taken
        self._off = np.zeros(3)

    def pull(self, world: World, palm: np.ndarray, speed: np.ndarray, alone: bool) -> np.ndarray:
        """(3,) the force on the thing [N], which is applied; alone, it also keeps the thing as it was turned."""
        import mujoco

        if self.at is None:
            return np.zeros(3)
        data, body = world.data, world.thing
        turn = data.xmat[body].reshape(3, 3)
        point, moving = data.xpos[body] + turn @ self.at, np.zeros(6)
        mujoco.mj_objectVelocity(world.model, data, mujoco.mjtObj.mjOBJ_BODY, body, moving, 0)
        velocity = moving[3:] + np.cross(moving[:3], point - data.xpos[body])
        light = min(1.0, world.place.mass / 2.0)  # a light thing is not held as stiffly
        force = STIFF * light * (palm - point) + DAMP * light * (speed - velocity)
        force *= min(1.0, STRONG / max(float(np.linalg.norm(force)), 1e-9))
        torque = np.zeros(3)
        if alone and self.turn is not None:
            off = self.turn @ turn.T
            torque = TURN * np.array([off[2, 1] - off[1, 2], off[0, 2] - off[2, 0], off[1, 0] - off[0, 1]]) / 2
            torque -= TURN_DAMP * moving[:3]
        mujoco.mj_applyFT(world.model, data, force, torque, point, body, data.qfrc_applied)
        return force

    def place(self, world: World, palm: np.ndarray) -> np.ndarray:
        """(3,) where it is, asked once a tick: at what it holds, or where it was to be, without a jump between."""
        if self.at is None:
            self._off = self._off * np.exp(-TICK / LETS_GO)
        else:
            turn = world.data.xmat[world.thing].reshape(3, 3)
            goal = world.data.xpos[world.thing] + turn @ self.at - palm
            self._off = self._off + (1 - np.exp(-TICK / 0.02)) * (goal - self._off)
        return np.asarray(palm + self._off)


def act(
    plan: Plan, robot: Robot, rng: np.random.Generator, film: tuple[str, int] | None = None, patience: float = 0.0
) -> Trial:
    """Play a trial. robot: what the servos are to reach, asked at every tick with its number, and a row where one is
    there. film: a camera, and how many ticks between two pictures. patience: how long the person waits at most [s]."""
    import mujoco

    from experiments.study.film import camera

    world = World(plan.place, plan.person.height, SHIRTS[int(1000 * plan.person.height) % len(SHIRTS)])
    model, data = world.model, world.data
    world.put(plan.thing)
    joints, closed = robot(-1, None)
    data.qpos[world.arm] = joints
    world.command(joints, closed)
    for _ in range(240):  # all comes to rest
        mujoco.mj_step(model, data)
    sensors, hands = Sensors(plan.person, rng), (Hand(), Hand())
    rows: list[np.ndarray] = []
    hid: list[float] = []
    frames: list[np.ndarray] = []
    show = camera(model, film[0]) if film else None
    look = show.__enter__() if show else None
    try:
        tick, waited, nearest = -1, 0, np.inf
        while (time := (tick + 1 - waited) * TICK) < plan.duration:
            tick += 1
            palms, soon = plan.palms(time), plan.palms(time + TICK)
            nearest = min(nearest, _off(plan, world, palms)) if time >= plan.waits - 1.0 else nearest
            if time >= plan.waits > time - TICK and waited * TICK < patience and not _ready(plan, world, palms, closed):
                waited += 1
                soon = palms
            _hold(plan, world, hands, palms, time, EAGER if patience else 0.0)
            held = np.stack([hand.place(world, palm) for hand, palm in zip(hands, palms, strict=True)])
            feet = plan.feet(time)
            skeleton = posture(plan.person.height, plan.back, plan.pelvis(time), feet, held, ease=0.06)
            load = np.zeros((2, 3))
            for _ in range(STEPS):
                data.qfrc_applied[:] = 0
                for i, hand in enumerate(hands):
                    load[i] = -hand.pull(world, palms[i], (soon[i] - palms[i]) / TICK, plan.place is HANDOVER)
                mujoco.mj_step(model, data)
            unseen = hidden(model, data, skeleton, plan.place)
            row = sensors.take(Moment(skeleton, load, plan.grip(time), feet[:, 2], unseen))
            if row is not None:
                rows.append(np.concatenate([row, world.joints, [closed]]))
                hid.append(float(unseen.mean()))
            joints, closed = robot(tick, row)
            world.command(joints, closed)
            if look is not None and film is not None and tick % film[1] == 0:
                world.person.place(data, skeleton)
                mujoco.mj_forward(model, data)
                frames.append(look(data))
    finally:
        if show:
            show.__exit__(None, None, None)
    times = np.arange(len(rows)) * SYNC * TICK
    done, says = _judged(plan, world, hands)
    says |= {"nearest": nearest}
    return Trial(times, np.array(rows), np.array(hid), done, says, waited * TICK, frames)


def _off(plan: Plan, world: World, palms: np.ndarray) -> float:
    """How far the robot is from what the person waits for [m]: with the thing from their hand, or from the handle."""
    at = world.data.xpos[world.thing]
    if plan.place is HANDOVER:
        return float(np.linalg.norm(at - palms[0]))
    turn = world.data.xmat[world.thing].reshape(3, 3)
    handle = at + turn @ [plan.place.thing[0] + 0.6 * HANDLE, 0.0, 0.0]
    return float(np.linalg.norm(world.data.site_xpos[world.pinch] - handle))


def _ready(plan: Plan, world: World, palms: np.ndarray, closed: float) -> bool:
    """Whether the person sees that they can go on: the thing within their grasp, or the robot's fingers closed."""
    return _off(plan, world, palms) < WITHIN if plan.place is HANDOVER else closed > 0.8


def _hold(plan: Plan, world: World, hands: tuple[Hand, Hand], palms: np.ndarray, time: float, eager: float) -> None:
    """Take hold of the thing, and let go, when it is time; eager: so much sooner what is in the hand already [s]."""
    begin, end = plan.holds
    if plan.place is HANDOVER and _off(plan, world, palms) < AT_HAND:
        begin -= eager
    if not begin <= time < end:
        for hand in hands:
            hand.at = None
        return
    turn, at = world.data.xmat[world.thing].reshape(3, 3), world.data.xpos[world.thing]
    for i in range(1 if plan.place is HANDOVER else 2):
        reached = np.linalg.norm(palms[i] - at) < (WITHIN if plan.place is HANDOVER else np.inf)
        if hands[i].at is None and reached:
            hands[i].at = turn.T @ (palms[i] - at)
            hands[i].turn = turn.copy()


def _judged(plan: Plan, world: World, hands: tuple[Hand, Hand]) -> tuple[bool, dict[str, float]]:
    """Whether the thing is where it was to go, and how far from it."""
    at, turn = world.data.xpos[world.thing], world.data.xmat[world.thing].reshape(3, 3)
    tilt = float(np.arccos(np.clip(turn[2, 2], -1, 1)))
    tool = float(np.linalg.norm(world.data.site_xpos[world.pinch] - at))
    if plan.place is HANDOVER:
        off = float(np.linalg.norm(at - plan.palms(plan.duration)[0]))
        return hands[0].at is not None and off < WITHIN + 0.05 and tool > 0.10, {"off": off, "tilt": tilt}
    x, y, wide, deep, top = plan.place.tops[1]
    on = abs(at[0] - x) < wide and abs(at[1] - y) < deep and abs(at[2] - top - plan.place.thing[2]) < 0.02
    return bool(on and tilt < 0.05), {"off": float(abs(at[2] - top - plan.place.thing[2])), "tilt": tilt}


def leading(plan: Plan, way: np.ndarray) -> Robot:
    """A robot whose joints go this way (T, 6), at every tick."""

    def robot(tick: int, row: np.ndarray | None) -> tuple[np.ndarray, float]:
        at = min(max(tick, 0), len(way) - 1)
        return way[at], float(plan.closed(at * TICK)[0])

    return robot


def demonstrated(plan: Plan, rng: np.random.Generator, film: tuple[str, int] | None = None) -> Trial:
    """The robot is led along its way."""
    return act(plan, leading(plan, led(plan)), rng, film)
