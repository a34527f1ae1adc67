"""From a material to a slider: stiffness, mass and viscosity of a slab."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Annotated, ClassVar, Literal, NamedTuple

from pyfric.values import Name, NotNegative, Positive, SceneError, part, unknown


class Known(NamedTuple):
    """Properties of a material from a source; None if the source does not give the value.

    Attributes:
        E: Young's modulus, Pa.
        density: density, kg/m^3.
        source: the source.
    """

    E: float
    density: float | None
    source: str


# fmt: off
MATERIALS: Mapping[str, Known] = MappingProxyType({
    "PMMA": Known(3.3e9, 1190.0, "PTEROFLAT XT acrylic sheets, technical data sheet (Politem): "
                  "tensile modulus by ISO 527-2, density by ISO 1183"),
    "glass": Known(70e9, 2500.0, "EN 572-1, basic soda-lime silicate glass"),
    "borosilicate glass": Known(64e9, 2230.0, "BOROFLOAT 33, mechanical properties (Schott)"),
    "steel": Known(210e9, 7850.0, "EN 1993-1-1, 3.2.6; density: EN 1991-1-1, table A.4"),
    "natural rubber": Known(1.5e6, 950.0, "MatWeb, Natural Rubber, Vulcanized: three times the "
                            "shear modulus of 0.5 MPa; density uncompounded"),
    "PDMS 10:1": Known(2.0e6, None, "Z. Wang, A. A. Volinsky, N. D. Gallant, J. Appl. Polym. Sci. "
                       "131, 41050 (2014): 20 MPa over the ratio of base to curing agent, in "
                       "compression"),
    "gelatine 20:1": Known(4.34e3, None, "J. E. Bonavia et al., arXiv:2512.20502 (2025): "
                           "instantaneous, in compression, 20 parts of water to 1 of powder"),
})
# fmt: on
"""Materials by name, each with its source."""


PLANE_STRAIN = 0.25
"""Poisson's ratio of the lattice as a body in plane strain."""


@part
class Material:
    """An elastic, viscous solid and the width of a slab of it, from which a `Slider` follows.

    The lattice is a thin plate, in plane stress, with a fixed Poisson's ratio of 1/3. In plane
    stress k = 3 B E/4, the shear modulus is 3 E/8, and waves have speeds sqrt(9 E/(8 rho)) and
    sqrt(3 E/(8 rho)). With plane = "strain" the lattice is a wide body with a ratio of 1/4: E is
    replaced by E/(1 - nu^2) = 16 E/15. In a slab of few blocks waves are faster; see
    `Slider.of_material`.

    Nearly incompressible solids (rubber, gels) have a ratio near 1/2 and a shear modulus of E/3.
    For them use E from tension of a strip, or 8/3 of the shear modulus if shear matters. Their
    pressure waves are not reproduced.

    Args:
        width: B, width of the slab, m.
        name: a key of `MATERIALS`, for values that are not given; "" for none.
        E: Young's modulus, Pa.
        density: rho, kg/m^3.
        viscosity: bulk viscosity, Pa s. Long waves of wave number q decay at the rate viscosity
            q^2/(2 rho). With dashpots "full" all long waves have this rate: the force per volume is
            viscosity times the Laplacian of the velocity, and each bond has eta = B viscosity/3,
            independent of l. With dashpots "along" the bonds the viscosity is anisotropic, and each
            bond has eta = B viscosity. Shear waves along x and z then have this rate. Pressure
            waves along x and z decay twice as fast. At 45 degrees, shear waves decay half as fast
            and pressure waves 2.5 times as fast. None means the paper's eta = sqrt(0.1 k m), which
            falls with l. With dashpots "full" the paper's eta is a viscosity of 0.82 l sqrt(E rho),
            which damps waves of a few blocks for every l.
        plane: "stress" or "strain".

    Source: PRL 107, 074301 (2011), model section, for k and eta.
    """

    width: Annotated[float, Positive("m")]
    name: Annotated[str, Name(40)] = ""
    E: Annotated[float, Positive("Pa", optional=True)] = None  # None: value of the named material
    density: Annotated[float, Positive("kg/m^3", optional=True)] = None
    viscosity: Annotated[float | None, NotNegative("Pa s", optional=True)] = None
    plane: Literal["stress", "strain"] = "stress"

    _section: ClassVar[str] = "slider.material"
    _positions: ClassVar[tuple[str, ...]] = ("name",)

    def __post_init__(self) -> None:
        if self.name and self.name not in MATERIALS:
            raise unknown("slider.material.name", self.name, self.name, MATERIALS)
        for field, unit in (("E", "Pa"), ("density", "kg/m^3")):
            if getattr(self, field) is None:
                known = getattr(MATERIALS.get(self.name), field, None)
                if known is None:
                    reason = f"not known of {self.name}" if self.name else "missing"
                    allowed = f"a finite number > 0 {unit}"
                    raise SceneError(f"slider.material.{field}", None, unit, allowed, reason)
                object.__setattr__(self, field, known)

    @property
    def k(self) -> float:
        """Stiffness of nearest-neighbour springs in N/m: 3 B E/4, times 16/15 in plane strain."""
        k = 0.75 * (self.width * self.E)
        return k if self.plane == "stress" else k / (1 - PLANE_STRAIN**2)

    def eta(self, dashpots: Literal["full", "along"]) -> float | None:
        """Return the viscosity of each bond, in N s/m; None means the paper's viscosity.

        A shear wave along x meets one bond along x and two diagonals for each block. Dashpots
        "full" resist the whole motion of the wave, so that eta = B viscosity/3. Dashpots "along"
        resist no motion in the bond along x and half of the motion in the diagonals, so that eta =
        B viscosity.
        """
        if self.viscosity is None:
            return None
        return self.width * self.viscosity / {"full": 3, "along": 1}[dashpots]
