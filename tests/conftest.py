"""Settings shared by all tests."""

import gc
import os
import signal
import sys

# Several workers with several BLAS threads each wait for each other.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# So do several workers whose threads spin while they wait.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")

import pytest
from hypothesis import HealthCheck, settings

settings.register_profile(
    "pyfric", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("pyfric")

# All that is collected stays: to look through it again and again takes time.
gc.disable()

# What is started in the background may ignore Ctrl-C, and under nohup SIGHUP; tests send both.
signal.signal(signal.SIGINT, signal.default_int_handler)
if hasattr(signal, "SIGHUP"):
    signal.signal(signal.SIGHUP, signal.SIG_DFL)

LAPACK = (
    *("arrivals", "balance", "banded", "cases", "chart", "claims", "coarse", "complementarity"),
    *("condensation", "constants", "contact", "creep", "crossing", "dashpots", "disorder"),
    *("drives", "edges", "equilibrium", "fields", "figures", "finer", "fits", "fronts"),
    *("gravity", "guard", "heights", "hybrid", "jump", "lattice", "laws", "limits"),
    *("measured_errors", "methods", "moving", "nucleation", "off_box", "operators", "pairs"),
    *("pauses", "prescribed", "protocol", "quasistatic", "rate_state", "rates", "reference"),
    *("regimes", "relaxation", "resolution", "resolved", "simulation", "sizes", "slipping"),
    *("slow_slip", "spacetime", "stability", "starts", "stopping", "theory", "weakening"),
    *("works", "zones"),
)
"""Files of tests that solve or factorise with LAPACK, and so depend on the kernel of BLAS."""
LONGEST = ("studies", "slow_slip", "fits", "hybrid", "record", "rate_state", "workers", "protocol")
LONGEST += ("signals", "steppers", "simulation", "quasistatic", "slipping", "junctions", "cases")
"""Files that take longest; they start first, so that no worker is left with one of them."""
PORTABLE = ("complementarity", "condensation", "constants", "crossing", "relaxation")
"""Those of them that are quick; single tests of others are marked where they are."""


@pytest.fixture(autouse=True)
def coarse_pictures():
    """Pictures of few dots, which take a third of the time; once figures are there to be drawn."""
    if style := sys.modules.get("pyfric.figures.style"):
        style.PNG_DPI = 60


@pytest.fixture
def coarse_curves(monkeypatch):
    """Loading curves of 150 points instead of 5000, and so fewer calls of the core."""
    from pyfric.engines import options

    monkeypatch.setattr(options, "POINTS", 150)


def _price(monkeypatch, steps):
    from pyfric.engines.skip import Prices

    monkeypatch.setattr(Prices, "in_steps", lambda self, counts: steps)


@pytest.fixture
def cheap_attempts(monkeypatch):
    """Attempts to jump at the price of 40 steps: more of them on small lattices."""
    _price(monkeypatch, 40.0)


@pytest.fixture
def free_attempts(monkeypatch):
    """Attempts to jump at the price of six steps: as many as there can be, which takes long."""
    _price(monkeypatch, 6.0)


def pytest_collection_finish():
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)  # records and figures leave little to find
    gc.enable()


def pytest_configure(config):
    config.option.loadscopereorder = False  # else files with many tests start first


def pytest_collection_modifyitems(items):
    place = {f"test_{name}": n for n, name in enumerate(LONGEST)}
    items.sort(key=lambda item: place.get(item.path.stem, len(place)))
    for item in items:
        name = item.path.stem.removeprefix("test_")
        if name in LAPACK:
            item.add_marker(pytest.mark.lapack)
        if name in PORTABLE:
            item.add_marker(pytest.mark.portable)
