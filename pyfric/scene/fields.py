"""Fields of the interface: numbers, or values for each block, given or drawn."""

import functools
from dataclasses import replace
from typing import Any

import numpy as np

from pyfric.scene.lattice import Lattice
from pyfric.scene.parts import FIELDS, OPTIONAL, Interface
from pyfric.values import naming


class Fields(Lattice):
    """The fields of the interface, which may vary along it, as arrays from left to right."""

    @property
    def fields(self) -> tuple[str, ...]:
        """Names of the fields that may vary along the interface."""
        given = (n for n in (*OPTIONAL, *self.interface.law.fields) if self._given(n) is not None)
        return (*FIELDS[: -len(OPTIONAL)], *given)

    @property
    def varied(self) -> tuple[str, ...]:
        """Names of the fields that vary along the interface."""
        return tuple(
            name for name in self.fields if self.field(name).min() < self.field(name).max()
        )

    def field(self, name: str) -> np.ndarray:
        """Return a field of the interface, left to right, shape (N_x,).

        Args:
            name: "mu_s", "mu_k", "d_c" (m), "alpha" (N s/m), "k_f" (N/m), "gap" (m), "slip" (m) or
                "limit_from" (s), or a field of the friction law.
        """
        return np.broadcast_to(np.asarray(self.given_field(name), dtype=float), (self.N_x,))

    def given_field(self, name: str) -> float | np.ndarray:
        """Return a field as a number, or as an array from left to right."""
        given = self._given(name)
        given = self.slider.k if given is None else given
        if isinstance(given, float):
            return given
        found = self._by_column(self.drawn.get(name, given))
        found.flags.writeable = False
        return found

    @functools.cached_property
    def drawn(self) -> dict[str, tuple[float, ...]]:
        """Values of fields that are a `Spread` or a `Profile`, from the trailing edge on."""
        given = {name: self._given(name) for name in self.fields}
        spreads = {name: field for name, field in given.items() if hasattr(field, "draw")}
        found, coefficient = {}, self.interface.law.coefficient
        for name, spread in spreads.items():
            stream = coefficient if coefficient and name in ("mu_s", "mu_k") else name
            with naming(f"{self._owner(name)._section}.{name}", type(spread).__name__):
                found[name] = tuple(spread.draw(self.N_x, self.slider.l, stream).tolist())
        return found

    def _given(self, name: str) -> Any:
        """Return a field as given in the interface or its friction law."""
        return getattr(self._owner(name), name)

    def _owner(self, name: str) -> Any:
        """Return the part that has the field: the interface or its friction law."""
        return self.interface if name in FIELDS else self.interface.law

    def interface_on(self, N_x: int) -> Interface:
        """Return the interface of the same slider with N_x blocks.

        Fields are interpolated; fields that are functions of x stay the same. alpha of a block is
        proportional to the block length. A block touches the foundation if the nearest original
        block touches it.
        """
        at, now = np.linspace(0, 1, N_x), np.linspace(0, 1, self.N_x)
        order = np.argsort(self.n_of_i)
        new = {
            name: tuple(np.interp(at, now, self.field(name)[order]).tolist())
            for name in self.fields
            if not isinstance(given := self._given(name), float | None)
            and (name == "alpha" or not getattr(given, "in_space", False))
        }
        law = {name: new.pop(name) for name in self.interface.law.fields if name in new}
        share = (self.N_x - 1) / (N_x - 1)
        alpha = np.multiply(new.get("alpha", self.interface.alpha), share).tolist()
        new["alpha"] = tuple(alpha) if isinstance(alpha, list) else alpha
        if isinstance(given := self.interface.contact, tuple):
            nearest = np.rint(at * (self.N_x - 1)).astype(int)
            new["contact"] = tuple(given[n] for n in nearest.tolist())
        return replace(self.interface, law=replace(self.interface.law, **law), **new)

    @functools.cached_property
    def touches(self) -> np.ndarray:
        """Blocks that can touch the foundation, left to right, shape (N_x,), bool."""
        given = self.interface.contact
        return self._by_column(True if given is None else given)

    @functools.cached_property
    def gap(self) -> float | np.ndarray:
        """Height of the undeformed blocks over the foundation, a number or (N_x,), in m."""
        return 0.0 if self.interface.gap is None else self.given_field("gap")

    @functools.cached_property
    def home(self) -> np.ndarray:
        """Positions u_x of the blocks at which they stick at the start, shape (N_x,), in m."""
        slip = self.interface.slip
        return np.zeros(self.N_x) if slip is None else self.d * self.field("slip")

    @functools.cached_property
    def k_f(self) -> float | np.ndarray:
        """Stiffness of the foundation per block in N/m, by default k.

        A number, or an array from left to right, shape (N_x,). k_f is 0 under blocks without
        contact, and for a prescribed interface in two dimensions, which has no foundation.
        """
        if self.prescribed:
            return 0.0
        given = self.given_field("k_f")
        if self.slider.edges == "half":
            given = given * self.shares[1]
        return given if self.touches.all() else np.where(self.touches, given, 0.0)
