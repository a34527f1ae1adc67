"""The simulated system: parts, scenes, presets, units, geometry."""

from importlib.metadata import version

from pyfric.scene import laws
from pyfric.scene.calls import usage
from pyfric.scene.change import followed_by, full_name, once, scene_fields
from pyfric.scene.checked import (
    Annotation,
    NotNegative,
    Positive,
    Quantity,
    Words,
    Written,
    annotations,
    part,
)
from pyfric.scene.composed import NO_LIMIT, OnDriven
from pyfric.scene.consistency import Geometry, check_geometry, check_push, default_geometry
from pyfric.scene.ends import Conditions, condition
from pyfric.scene.errors import SceneError, naming, unknown
from pyfric.scene.files import (
    check_folder_name,
    check_free,
    check_writable,
    clean_drafts,
    figure_stem,
    read_at_most,
    sealed,
    unsealed,
    write,
    write_all,
    written,
)
from pyfric.scene.friction import FRICTIONLESS, Law, of, slipped
from pyfric.scene.materials import MATERIALS, Material
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
    SETTABLE,
    Number,
    SceneLike,
    as_scene,
    chain,
    density_notes,
    paper_step,
    preset,
    presets,
    settings,
    setup1,
    setup2,
    slab,
)
from pyfric.scene.profile import Profile
from pyfric.scene.protocol import Leg, Push, legs, thinned
from pyfric.scene.restless import RateStateLaw
from pyfric.scene.scene import Scene
from pyfric.scene.spread import Spread
from pyfric.scene.tables import (
    COMMA,
    POINT,
    THOUSANDS,
    cells_of,
    fits,
    is_number,
    separator_of,
    unit_in,
)
from pyfric.scene.text import law_notes
from pyfric.scene.toml import parsed
from pyfric.scene.units import (
    LARGEST,
    PREFIXES,
    SMALLEST,
    check_number,
    check_unmasked,
    check_whole,
    parse_quantity,
    prefix_power,
    spoken,
)
from pyfric.scene.words import LINES, line, meant, nearest, no_attribute, plain

__version__ = version("pyfric")
