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

# Objects of the collection live until the end; searching them again and again takes time.
gc.disable()

# A background process may ignore Ctrl-C, and under nohup SIGHUP. Tests send both signals.
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
"""Files that take longest. These start first, so that no worker ends up alone with one."""
PORTABLE = ("complementarity", "condensation", "constants", "crossing", "relaxation")
"""Files of `LAPACK` that are quick. Single tests of the other files carry a mark."""


@pytest.fixture(autouse=True)
def coarse_pictures():
    """Draw pictures at low resolution, in a third of the time, once figures are imported."""
    if style := sys.modules.get("pyfric.figures.style"):
        style.PNG_DPI = 60


@pytest.fixture
def coarse_curves(monkeypatch):
    """Use loading curves of 150 points in place of 5000, for fewer calls of the core."""
    from pyfric.engines import options

    monkeypatch.setattr(options, "POINTS", 150)


def _price(monkeypatch, steps):
    from pyfric.engines.skip import Prices

    monkeypatch.setattr(Prices, "in_steps", lambda self, counts: steps)


@pytest.fixture
def cheap_attempts(monkeypatch):
    """Price an attempt to jump at 40 steps, so that small lattices have more attempts."""
    _price(monkeypatch, 40.0)


@pytest.fixture
def free_attempts(monkeypatch):
    """Set the price of an attempt to jump to six steps, for as many attempts as possible; slow."""
    _price(monkeypatch, 6.0)


def pytest_collection_finish():
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)  # records and figures leave few cycles to collect
    gc.enable()


def pytest_configure(config):
    config.option.loadscopereorder = False  # otherwise files with many tests start first


def pytest_collection_modifyitems(items):
    place = {f"test_{name}": n for n, name in enumerate(LONGEST)}
    items.sort(key=lambda item: place.get(item.path.stem, len(place)))
    for item in items:
        name = item.path.stem.removeprefix("test_")
        if name in LAPACK:
            item.add_marker(pytest.mark.lapack)
        if name in PORTABLE:
            item.add_marker(pytest.mark.portable)
