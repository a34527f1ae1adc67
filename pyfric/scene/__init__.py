"""What is simulated: parts, scenes, presets, units, geometry."""

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
)
from pyfric.scene.presets import (
    PRESETS,
    SceneLike,
    as_scene,
    chain,
    names_file,
    preset,
    run3,
    setup1,
    setup2,
)
from pyfric.scene.scene import Scene
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
    "__version__",
    "as_scene",
    "chain",
    "check_geometry",
    "check_number",
    "check_writable",
    "clean_drafts",
    "clock",
    "default_geometry",
    "drafts",
    "names_file",
    "nearest",
    "parse_quantity",
    "preset",
    "range_text",
    "run3",
    "sealed",
    "setup1",
    "setup2",
    "slipped",
    "unknown",
    "unsealed",
    "write",
    "written",
]
