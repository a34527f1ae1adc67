"""What is simulated: parts, scenes, presets, units, geometry."""

from pyfric.scene import laws
from pyfric.scene.change import full_name, scene_fields
from pyfric.scene.checked import Quantity, quantities
from pyfric.scene.files import (
    check_writable,
    clean_drafts,
    drafts,
    sealed,
    unsealed,
    write,
    written,
)
from pyfric.scene.friction import FRICTIONLESS, Law, clock, of, slipped
from pyfric.scene.geometry import Geometry, check_geometry, default_geometry
from pyfric.scene.parts import (
    FIELDS,
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
    settings,
    setup1,
    setup2,
    slab,
)
from pyfric.scene.protocol import Leg, Piece, legs
from pyfric.scene.scene import Scene
from pyfric.scene.spread import Spread
from pyfric.scene.toml import parsed, read_value
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
    "FIELDS",
    "FRICTIONLESS",
    "PRESETS",
    "DistributedLoad",
    "Driver",
    "Geometry",
    "Interface",
    "Law",
    "Leg",
    "Piece",
    "PrescribedLoad",
    "Quantity",
    "Rod",
    "Scene",
    "SceneError",
    "SceneLike",
    "Slider",
    "Spread",
    "Walls",
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
    "full_name",
    "laws",
    "legs",
    "names_file",
    "nearest",
    "of",
    "paper_step",
    "parse_quantity",
    "parsed",
    "preset",
    "quantities",
    "range_text",
    "read_value",
    "run3",
    "scene_fields",
    "sealed",
    "settings",
    "setup1",
    "setup2",
    "slab",
    "slipped",
    "unknown",
    "unsealed",
    "write",
    "written",
]
