"""CPU time of a scan with 360 rays in furnished rooms of `sonata-2020` with 10 people, and a digest of all ranges.

python benchmarks/lidar.py [--rooms 20] [--rays 360] [--repeats 400]

A robot drives for up to 60 ticks in each room; the scan of its last state is measured again and again. Two versions of
sonata2d that print the same digest measure the same ranges.
"""

from __future__ import annotations

import argparse
import hashlib
import statistics
import time

import sonata2d as s2
from sonata2d.agents import Lidar
from sonata2d.agents.sensors.base import SensorNoise
from sonata2d.core.snapshot import Snapshot

TICKS, DRIVE = 60, s2.Twist(0.5, 0.0, 0.3)


def scenario() -> s2.ScenarioConfig:
    """Rooms with 10 people and 8 pieces of furniture."""
    return s2.load_scenario("sonata-2020").changed(standing=5, wandering=5, tables=4, plants=4, relations=0)


def main() -> None:
    """Measure all rooms."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name, default in (("rooms", 20), ("rays", 360), ("repeats", 400)):
        parser.add_argument(f"--{name}", type=int, default=default)
    arguments = parser.parse_args()
    lidar, digest, costs = Lidar(rays=arguments.rays), hashlib.sha256(), list[float]()

    class Scanning(s2.Controller):
        sensors = (lidar,)
        last: Snapshot

        def act(self, snapshot: Snapshot) -> s2.Twist:
            digest.update(snapshot.sensors.lidar.ranges.tobytes())
            self.last = snapshot
            return DRIVE

    for seed in range(arguments.rooms):
        scene, controller = s2.generate(scenario(), seed=seed), Scanning()
        episode = s2.Episode(scene, controller)
        for _ in range(TICKS):
            if episode.step() is None:
                break
        measure, noise, times = lidar.start(scene), SensorNoise(scene, lidar.name, 0), list[float]()
        for _ in range(arguments.repeats):
            start = time.thread_time()
            measure(controller.last, noise)
            times.append(time.thread_time() - start)
        costs.append(1e6 * statistics.median(times))
    print(f"{arguments.rays} rays: {statistics.mean(costs):.1f} us in the mean, {max(costs):.1f} in the slowest room")
    print(f"ranges {digest.hexdigest()[:16]}")


if __name__ == "__main__":
    main()
