"""Friction laws: `pyfric.scene.laws`, under the name by which users import them."""

import sys
from typing import TYPE_CHECKING

from pyfric.scene import laws

if TYPE_CHECKING:
    from pyfric.scene.laws import *  # noqa: F403

sys.modules[__name__] = laws
