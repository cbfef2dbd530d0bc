"""Set-up of all tests: hypothesis profiles, and a coverage cache of the session's own."""

import gc
import os
import signal
from collections.abc import Iterator

import pytest
from hypothesis import HealthCheck, settings

COMMON = {
    "deadline": None,
    "database": None,
    "suppress_health_check": [
        HealthCheck.too_slow,
        HealthCheck.data_too_large,
        HealthCheck.nested_given,  # the pool draws some again
    ],
}
settings.register_profile("ci", derandomize=True, **COMMON)
settings.register_profile("random", **COMMON)  # with COCAP_OPT_EXAMPLES=20: a hunt for bugs
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "ci"))


if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # as a shell leaves it in the background
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_configure(config: pytest.Config) -> None:
    """Let properties go through fewer examples where slow tests are left out."""
    if "not slow" in config.option.markexpr:
        os.environ.setdefault("COCAP_OPT_EXAMPLES", "0.1")


@pytest.hookimpl(tryfirst=True)  # before tests are left out by their markers
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with what takes longest, so that no worker ends long after the others."""
    for item in items:
        if (marker := item.get_closest_marker("long")) is not None:
            item.add_marker(pytest.mark.slow(**marker.kwargs))
    items.sort(key=_seconds, reverse=True)


def pytest_collection_finish() -> None:
    """Leave modules and tests out of all later garbage collections, and collect less often.

    They stay to the end, as do caches, which are a million objects before long.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(10_000, 20, 20)


def _seconds(item: pytest.Item) -> float:
    """Seconds that a slow test says it takes; 0 where it says nothing."""
    marker = item.get_closest_marker("slow")
    return marker.kwargs.get("seconds", 0.0) if marker else 0.0


@pytest.fixture(scope="session", autouse=True)
def own_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Keep the tests out of the user's cache; processes started by a test inherit this.

    The workers of a session share one, so that each scene's coverage is computed once.
    """
    folder = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        folder = folder.parent
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("COCAP_OPT_CACHE", str(folder / "cache"))
        if "PYTHONDONTWRITEBYTECODE" in os.environ:
            # Nothing goes into the tree; processes still need not compile all modules each.
            patch.delenv("PYTHONDONTWRITEBYTECODE")
            patch.setenv("PYTHONPYCACHEPREFIX", str(folder / "bytecode"))
        yield
