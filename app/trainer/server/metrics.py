"""The trainer's figures in Prometheus' text."""

from collections.abc import Callable

from prometheus_client import CollectorRegistry, Counter, Gauge, ProcessCollector, generate_latest

from app.trainer.connections.bounds import Connections
from app.trainer.server.fixed_rate_timer import FixedRateTimer


def trainer_metrics(
    pages: Callable[[], int], timer: FixedRateTimer, connections: Connections
) -> Callable[[], bytes]:
    """Return a function that gives a trainer's figures as they are then."""
    registry = CollectorRegistry()
    ProcessCollector(registry=registry)

    def gauge(name: str, what: str, value: Callable[[], float]) -> None:
        Gauge(f"bluntdissect_{name}", what, registry=registry).set_function(value)

    gauge("pages", "Pages that have a duct.", pages)
    gauge("connections", "Connections of pages and requests.", lambda: len(connections))
    gauge("upload_bytes", "Bytes of unfinished uploads.", lambda: connections.upload_bytes)
    gauge("ticks", "Ticks of 1/30 s that ran.", lambda: timer.ticks)
    gauge("ticks_missed", "Ticks that there was no time for.", lambda: timer.missed)
    refusals = Counter(
        "bluntdissect_refusals", "What was refused or had to wait.", ["what"], registry=registry
    )
    counted: dict[str, int] = {}

    def latest() -> bytes:
        for what, count in tuple(connections.refusals.items()):
            refusals.labels(what).inc(count - counted.get(what, 0))
            counted[what] = count
        return generate_latest(registry)

    return latest
