"""Available memory: of the machine, of its container, of the process."""

import pytest
from helpers import run_python

from pyfric.core import memory


@pytest.fixture(scope="module")
def said():
    """The output of one process whose memory limit changes repeatedly."""
    found = run_python('print("---")'.join((LIMITED, WITHOUT, REFUSED)))
    assert found.returncode == 0, found.stderr
    return dict(zip(("limited", "without", "refused"), found.stdout.split("---\n"), strict=True))


def test_a_container_may_have_less_memory(tmp_path, monkeypatch):
    files = [tmp_path / "max", tmp_path / "current"]
    monkeypatch.setattr(memory, "CONTAINERS", (files,))
    assert memory.available() > 1e8
    files[0].write_text("max\n")
    files[1].write_text("1000\n")
    assert memory.available() > 1e8
    files[0].write_text("5000\n")
    assert memory.available() == 4000
    files[1].write_text("6000\n")
    assert memory.available() == 0


LIMITED = """
import resource
from pyfric.core import available
whole = available()
pages = open("/proc/self/statm").read().split()
for limited, column in ((resource.RLIMIT_AS, 0), (resource.RLIMIT_DATA, 5)):
    size = int(pages[column]) * resource.getpagesize()
    resource.setrlimit(limited, (size + 200_000_000, resource.RLIM_INFINITY))
    print(available() / 1e6)
    resource.setrlimit(limited, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
assert available() > 0.5 * whole
"""


def test_limits_of_the_process_count(said):
    assert [float(line) for line in said["limited"].split()] == pytest.approx([200, 200], abs=20)


REFUSED = """
import resource
import pyfric.engines
pages = open("/proc/self/statm").read().split()
size = int(pages[0]) * resource.getpagesize() + 300_000_000
resource.setrlimit(resource.RLIMIT_AS, (size, size))
try:
    pyfric.simulate(pyfric.preset("fig1", l=0.1e-3), 0.1, fidelity="dynamic", progress=False)
except pyfric.SceneError as error:
    print(error.field, "GB are needed" in str(error))
"""


def test_a_run_beyond_the_limit_of_the_process_is_refused(said):
    assert said["refused"] == "slider.l True\n"


WITHOUT = """
import resource
from pyfric import core
from pyfric.scene import setup1
from pyfric.statics import loaded_state, stability_limit
scene = setup1(L=0.5, H=0.25)
dt = 0.5 * stability_limit(scene)[0]
state = loaded_state(scene, "linear").state(scene, dt)
model, log, before = core.model(scene, "linear", state.u_drv0), core.Log(scene.N_x), state.copy()
pages = open("/proc/self/statm").read().split()
size = int(pages[0]) * resource.getpagesize() + 10_000_000
resource.setrlimit(resource.RLIMIT_AS, (size, resource.RLIM_INFINITY))
taken = []
try:
    while True:
        taken.append(bytearray(500_000))
except MemoryError:
    pass
for call in (lambda: core.advance(model, state, log, 1), lambda: core.evaluate(model, state, 0.0)):
    try:
        call()
    except MemoryError as error:
        print(error)
del taken
resource.setrlimit(resource.RLIMIT_AS, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
assert state.step == 0 and (state.y == before.y).all()
print(core.advance(model, state, log, 1).name, state.step)
"""


def test_a_core_without_memory_says_so_and_goes_on_later(said):
    refusal = "the core has no memory for 201 x 101 blocks"
    assert said["without"].splitlines() == [refusal, refusal, "DONE 1"]
