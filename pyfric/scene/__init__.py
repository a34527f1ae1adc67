"""What is simulated: parts, scenes, presets, units, geometry."""

from pyfric.scene import laws
from pyfric.scene.checked import quantities
from pyfric.scene.files import (
    check_writable,
    clean_drafts,
    drafts,
    sealed,
    unsealed,
    write,
    written,
)
from pyfric.scene.friction import FRICTIONLESS, Law, clock, slipped
from pyfric.scene.geometry import Geometry, check_geometry, default_geometry
from pyfric.scene.parts import (
    DistributedLoad,
    Driver,
    Interface,
    PrescribedLoad,
    Rod,
    Slider,
    Walls,
)
from pyfric.scene.presets import (
    PRESETS,
    SceneLike,
    as_scene,
    chain,
    names_file,
    paper_step,
    preset,
    run3,
    setup1,
    setup2,
    slab,
)
from pyfric.scene.scene import Scene
from pyfric.scene.shown import DRAWINGS, html
from pyfric.scene.signals import (
    answered,
    asked_to_stop,
    at_once,
    commanded,
    forget,
    held_back,
    nothing_to_save,
    raise_if_asked,
    saved_first,
)
from pyfric.scene.spread import Spread
from pyfric.scene.units import (
    SceneError,
    check_number,
    nearest,
    parse_quantity,
    range_text,
    unknown,
)
from pyfric.scene.version import __version__

__all__ = [
    "DRAWINGS",
    "FRICTIONLESS",
    "PRESETS",
    "DistributedLoad",
    "Driver",
    "Geometry",
    "Interface",
    "Law",
    "PrescribedLoad",
    "Rod",
    "Scene",
    "SceneError",
    "SceneLike",
    "Slider",
    "Spread",
    "Walls",
    "__version__",
    "answered",
    "as_scene",
    "asked_to_stop",
    "at_once",
    "chain",
    "check_geometry",
    "check_number",
    "check_writable",
    "clean_drafts",
    "clock",
    "commanded",
    "default_geometry",
    "drafts",
    "forget",
    "held_back",
    "html",
    "laws",
    "names_file",
    "nearest",
    "nothing_to_save",
    "paper_step",
    "parse_quantity",
    "preset",
    "quantities",
    "raise_if_asked",
    "range_text",
    "run3",
    "saved_first",
    "sealed",
    "setup1",
    "setup2",
    "slab",
    "slipped",
    "unknown",
    "unsealed",
    "write",
    "written",
]
