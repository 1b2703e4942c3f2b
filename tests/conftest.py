"""No test writes where the person who runs it keeps real state, and none finds what another one has kept.

Nor does one find the gateways that person runs: locks and door files go to folders of the tests' own.

Where the tests are spread over processes, each is as strict about bytes and text as the one that was started.
"""

from __future__ import annotations

import gc
import itertools
import os
import shlex
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from tests.support import sampling
from tests.support.forked import Forked
from tests.support.process import ALIVE, Running

_COUNT = itertools.count()
#: New objects between two looks of the garbage collector, in its three generations.
SELDOM = (20_000, 20, 20)

# No example is measured: a small or a shared machine may take its time.
settings.register_profile("untimed", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("untimed")


def pytest_configure(config: pytest.Config) -> None:
    """Workers of pytest-xdist get ``-bb`` as well; by itself it starts them without.

    What is compiled is kept, by workers and by product processes, also where an image says otherwise: compiling the
    tests takes each worker four seconds, compiling the product takes each process as long as all else of its start.
    """
    sampling.WHOLE = config.getoption("whole") or any("::" in argument for argument in config.args)
    sys.dont_write_bytecode = False
    gc.disable()  # until everything is collected
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    if sys.flags.bytes_warning and getattr(config.option, "tx", None):
        strict = f"popen//python={shlex.quote(sys.executable)} -{'b' * sys.flags.bytes_warning}"
        config.option.tx = [strict if spec == "popen" else spec for spec in config.option.tx]


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--whole", action="store_true", help="play every combination of every grid, not a sample")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Grids of whole gateways are sampled, unless all of it is wanted or single tests are named."""
    if sampling.WHOLE:
        return
    if out := sampling.left_out(items):
        config.hook.pytest_deselected(items=[item for item in items if item in out])
        items[:] = [item for item in items if item not in out]


@pytest.hookimpl(trylast=True)
def pytest_collection_finish() -> None:
    """Thousands of tests live as long as their process: the garbage collector need not look through them each time.

    A play makes and drops hundreds of thousands of values, of which next to nothing needs the collector.
    """
    gc.freeze()
    gc.set_threshold(*SELDOM)
    gc.enable()


def pytest_sessionfinish() -> None:
    Forked.end()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call() -> Iterator[None]:
    """What a test itself has started ends with it, also when it fails: left open it makes others fail after it."""
    gc.set_threshold(*SELDOM)  # a command of the product that ran in this process has set its own
    before = len(ALIVE)
    try:
        return (yield)
    finally:
        for one in ALIVE[before:]:
            one.end_at_once()


@pytest.fixture(scope="session", autouse=True)
def _states(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Also for what runs longer than one test."""
    base = tmp_path_factory.mktemp("states")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("STATE_DIRECTORY", str(base))
        for name in ("XDG_RUNTIME_DIR", "TMPDIR"):
            patch.setenv(name, str(tmp_path_factory.mktemp(name.lower())))
        yield base


@pytest.fixture(autouse=True)
def _state(_states: Path) -> None:
    """Set by hand: ``monkeypatch`` takes longer than most tests. What there was before comes back at the end."""
    os.environ["STATE_DIRECTORY"] = f"{_states}/{next(_COUNT)}"


@pytest.fixture
def started() -> Iterator[list[Running]]:
    """Product processes that a test adds; they end with it."""
    running: list[Running] = []
    yield running
    for one in running:
        one.end_at_once()
