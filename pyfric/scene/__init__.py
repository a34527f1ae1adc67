"""The simulated system: parts, scenes, presets, units, geometry."""

from importlib.metadata import version

from pyfric.scene import laws
from pyfric.scene.change import followed_by, full_name, once, scene_fields
from pyfric.scene.consistency import Geometry, check_geometry, check_push, default_geometry
from pyfric.scene.ends import Conditions, condition
from pyfric.scene.friction import FRICTIONLESS, CoulombLaw, Law, Sums, Term, of, slipped
from pyfric.scene.lattice import OnDriven
from pyfric.scene.loads import NO_LIMIT
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
from pyfric.scene.restless import LAWS, JunctionLaw, RateStateLaw
from pyfric.scene.scene import Scene
from pyfric.scene.spread import Spread
from pyfric.scene.text import law_notes

__version__ = version("pyfric")
