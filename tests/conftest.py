"""Isolates the tests: no test touches the real state, locks or running gateways of the person who runs them.

A test that is a coroutine runs on virtual time, or with the mark ``real_time`` on the computer's own.

Every test gets a state folder of its own; locks, control endpoints and the cache go to temporary folders. No gateway
in a test process lets an almanac be calculated. Worker processes of pytest-xdist are as strict about bytes and text
(``-bb``) as the process that started them.
"""

from __future__ import annotations

import asyncio
import contextlib
import gc
import importlib
import inspect
import itertools
import os
import shlex
import sys
from collections.abc import Collection, Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from gateway.astro.ephemeris import keeper
from gateway.astro.ephemeris.almanac import Almanac
from gateway.astro.offline import go_offline
from gateway.diagnostics.virtual_time import run
from tests.support import sampling
from tests.support.forked import Forked
from tests.support.process import ALIVE, Running
from tests.support.random_order import seed, shuffled

_COUNT = itertools.count()
#: Allocations between two runs of the garbage collector, for its three generations.
GC_THRESHOLDS = (20_000, 20, 20)

# Hypothesis measures no example: a small or a shared machine may take its time.
settings.register_profile("untimed", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("untimed")


def pytest_configure(config: pytest.Config) -> None:
    """Give the workers of pytest-xdist ``-bb`` too, which it does not pass on, and turn bytecode files on.

    Bytecode is cached even if the environment says otherwise: compiling the tests costs each worker four seconds, and
    compiling the package costs each product process as much as the rest of its start.
    """
    seed()  # before any worker is started
    sampling.WHOLE = config.getoption("whole") or any("::" in argument for argument in config.args)
    sys.dont_write_bytecode = False
    gc.disable()  # until all tests are collected
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    if sys.flags.bytes_warning and getattr(config.option, "tx", None):
        strict = f"popen//python={shlex.quote(sys.executable)} -{'b' * sys.flags.bytes_warning}"
        config.option.tx = [strict if spec == "popen" else spec for spec in config.option.tx]


@pytest.hookimpl(tryfirst=True)
def pytest_collection(session: pytest.Session) -> None:
    """Import the tests in another order in each worker: what is not compiled yet is compiled once, not by all of them.

    What cannot be imported is reported by the collection that follows.
    """
    if worker := os.environ.get("PYTEST_XDIST_WORKER"):
        paths = [session.config.rootpath / argument.partition("::")[0] for argument in session.config.args]
        tests = sorted(test for path in paths for test in ([path] if path.is_file() else path.rglob("test_*.py")))
        first = len(tests) * int(worker.removeprefix("gw")) // int(os.environ["PYTEST_XDIST_WORKER_COUNT"])
        for test in tests[first:] + tests[:first]:
            with contextlib.suppress(Exception, pytest.skip.Exception):
                importlib.import_module(".".join(test.relative_to(session.config.rootpath).with_suffix("").parts))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    terminalreporter.write_line(f"TEST_ORDER={seed()} repeats this order")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--whole", action="store_true", help="play every combination of every grid, not a sample")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Deselect what the sample of a grid leaves out, unless everything is wanted or single tests are named."""
    if not sampling.WHOLE and (out := sampling.left_out(items)):
        config.hook.pytest_deselected(items=[item for item in items if item in out])
        items[:] = [item for item in items if item not in out]
    items[:] = shuffled(items)


@pytest.hookimpl(trylast=True)
def pytest_collection_finish() -> None:
    """Freeze what collection has created: thousands of tests live as long as their process.

    A run on virtual time creates and drops hundreds of thousands of values; the collector is needed for few of them.
    """
    gc.freeze()
    gc.set_threshold(*GC_THRESHOLDS)
    gc.enable()


def pytest_sessionfinish() -> None:
    Forked.end()


@pytest.hookimpl(tryfirst=True)
def pytest_pyfunc_call(pyfuncitem: pytest.Function) -> bool | None:
    """Run a test that is a coroutine; return None for any other, which pytest calls itself."""
    if not inspect.iscoroutinefunction(pyfuncitem.obj):
        return None
    fixtures = {name: pyfuncitem.funcargs[name] for name in inspect.signature(pyfuncitem.obj).parameters}
    run_it = asyncio.run if pyfuncitem.get_closest_marker("real_time") else run
    run_it(pyfuncitem.obj(**fixtures))
    return True


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call() -> Iterator[None]:
    """End the processes that a test has started, also if it fails: left running, they would make other tests fail."""
    gc.set_threshold(*GC_THRESHOLDS)  # a command of the product that ran in this process has set its own thresholds
    before = len(ALIVE)
    try:
        return (yield)
    finally:
        for one in ALIVE[before:]:
            one.end_at_once()


@pytest.fixture(scope="session", autouse=True)
def _states(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Set temporary folders for the whole run, also for fixtures that live longer than one test."""
    base = tmp_path_factory.mktemp("states")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("STATE_DIRECTORY", str(base))
        patch.delenv("CACHE_DIRECTORY", raising=False)
        for name in ("XDG_RUNTIME_DIR", "XDG_CACHE_HOME", "TMPDIR"):
            patch.setenv(name, str(tmp_path_factory.mktemp(name.lower())))
        patch.setattr(keeper, "DAYS_PER_CALCULATION", 0)
        patch.setattr(keeper, "calculate_in_process", _calculated)
        yield base


def _calculated(days: Collection[int]) -> Almanac:
    """Calculate an almanac in this process, which has often loaded astropy already: a process for it takes a second."""
    go_offline()
    from gateway.astro.ephemeris import by_astropy

    return by_astropy.calculate_almanac(days)


@pytest.fixture(autouse=True)
def _state(_states: Path) -> None:
    """Give each test its own folder. Set directly: ``monkeypatch`` takes longer than most tests."""
    os.environ["STATE_DIRECTORY"] = f"{_states}/{next(_COUNT)}"


@pytest.fixture
def started() -> Iterator[list[Running]]:
    """A list for the product processes that a test starts; the fixture ends them."""
    running: list[Running] = []
    yield running
    for one in running:
        one.end_at_once()
