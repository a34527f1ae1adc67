"""Analysis of records: `pyfric.record.analysis`, under the name by which users import it."""

import sys
from typing import TYPE_CHECKING

from pyfric.record import analysis

if TYPE_CHECKING:
    from pyfric.record.analysis import *  # noqa: F403

sys.modules[__name__] = analysis
