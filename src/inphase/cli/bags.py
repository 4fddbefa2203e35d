"""`inphase bags`: what there is in bags of ROS, and recordings made of them."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import tyro
from rich.table import Table as PrintedTable

from inphase.cli.console import Output, counted, waiting
from inphase.cli.reading import AsJson
from inphase.errors import DataError, OptionError, listing
from inphase.io.csv import write_csv
from inphase.io.files import episode_names
from inphase.runtime.adapters.bags import BagListing, BagTopic, LeftOut, TopicMap, list_bag, read_bag, read_topic_map

NOT_ALL = 1  # exit code
PLACES = 8  # that are shown of a topic

Bags = Annotated[
    tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="BAG...", help_behavior_hint="(required)")
]


def bags(
    files: Bags,
    map_: Annotated[Path | None, tyro.conf.arg(name="map", metavar="TOML", help_behavior_hint="")] = None,
    output: Annotated[Path | None, tyro.conf.arg(aliases=("-o",), metavar="FOLDER", help_behavior_hint="")] = None,
    json_: AsJson = False,
) -> int:
    """List the topics of ROS bags, or make recordings of them (--map, --output). Needs no ROS.

    Exit code 1 if no recording could be made of one of them.

    Args:
        files: bags: .bag, .db3 or .mcap files, or the folders of ROS 2
        map_: which number of which topic is which channel (docs/bags.md)
        output: write one CSV file a bag into this folder
        json_: print as JSON
    """
    if (map_ is None) != (output is None):
        raise OptionError("expected --map and --output together, or neither to list what there is")
    if map_ is None or output is None:
        return _list(files, json_)
    return _write(files, read_topic_map(map_), output, json_)


# ------------------------------------------------------------------------------------------------------------ listing


def _list(files: Sequence[Path], as_json: bool) -> int:
    with waiting(f"reading {counted(len(files), 'bag')}"):
        listings = [list_bag(path) for path in files]
    if as_json:
        json.dump([_described(found) for found in listings], sys.stdout, indent=1, allow_nan=False)
        print()
        return 0
    console = Output()
    for found in listings:
        _print(console, found)
    return 0


def _described(found: BagListing) -> dict[str, Any]:
    topics = [{**asdict(topic), "rate": topic.rate} for topic in found.topics]
    plain = [
        {key: None if isinstance(value, float) and math.isnan(value) else value for key, value in topic.items()}
        for topic in topics
    ]
    return {**asdict(found), "topics": plain}


def _print(console: Output, found: BagListing) -> None:
    table = PrintedTable(box=None, pad_edge=False)
    for title in ("topic", "type"):
        table.add_column(title, overflow="fold")
    for title in ("count", "rate", "first", "last [s]"):
        table.add_column(title, justify="right", no_wrap=True)
    table.add_column("stamps", no_wrap=True)
    table.add_column("places", overflow="fold")
    for topic in found.topics:
        numbers = (
            "" if math.isnan(n) else f"{n:.{d}f}" for n, d in ((topic.rate, 1), (topic.first, 3), (topic.last, 3))
        )
        places = f"cannot be read: {topic.problem}" if topic.problem else _shown(topic)
        stamps = "" if not topic.count else "own" if topic.stamped else "none"
        table.add_row(topic.topic, topic.type, str(topic.count), *numbers, stamps, places)
    console.print(f"{found.path}: {counted(len(found.topics), 'topic')}")
    console.print(table, soft_wrap=False)
    if found.damage:
        console.print(found.damage, style="red")


def _shown(topic: BagTopic) -> str:
    """The places of its numbers; of many the first and the last."""
    places = topic.places
    if len(places) <= PLACES:
        return " ".join(places)
    return f"{' '.join(places[: PLACES - 1])} … {places[-1]} ({len(places)})"


# ------------------------------------------------------------------------------------------------------------ writing


def _write(files: Sequence[Path], topic_map: TopicMap, folder: Path, as_json: bool) -> int:
    names = [name.replace("/", "-").strip("-") for name in episode_names(files)]
    if len(set(names)) < len(names):
        raise OptionError(f"expected bags of different names, got {listing(files)}")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OptionError(f"cannot write into {folder}: {error.strerror}") from None
    columns = [channel.name for channel in topic_map.channels]
    console, written, left_out = Output(quiet=as_json), list[Path](), list[LeftOut]()
    for path, name in zip(files, names, strict=True):
        try:
            with waiting(f"reading {path}"):
                demonstration, left = read_bag(path, topic_map)
        except DataError as error:
            left = [LeftOut(str(path), "", str(error).removeprefix(f"{path}: "))]
        else:
            target = folder / f"{name}.csv"
            write_csv(target, columns, demonstration.times, demonstration.values)
            written.append(target)
            size = f"{counted(len(demonstration), 'sample')}, {demonstration.duration:.2f} s"
            console.print(f"wrote {target}: {size}, {counted(len(columns), 'channel')}")
        left_out += left
    if not written:
        raise DataError(f"no recording was made: {'; '.join(str(one) for one in left_out)}")
    for one in left_out:
        console.print(f"left out: {one}", style="yellow")
    if as_json:
        told = {"written": [str(path) for path in written], "left_out": [asdict(one) for one in left_out]}
        json.dump(told, sys.stdout, indent=1)
        print()
    roles = (("--observed", topic_map.observed), ("--controlled", topic_map.controlled))
    wanted = " ".join(f"{option} {' '.join(names)}" for option, names in roles if names)
    console.print(f"next: inphase validate {folder} {wanted}", style="dim")
    return NOT_ALL if len(written) < len(files) else 0
