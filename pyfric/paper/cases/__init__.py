"""Published results of other models, reproduced: one module for each, `pyfric case NAME`.

    for result in pyfric.cases.run(["chain_fronts"]):
        print(result)

A case has a source, a number or trend with its target band, and a figure. A case also has damages:
changed scenes for which the number must be outside the band. Parts of a case are
`pyfric.claims.Claim`. A new case is a function with the decorator `@case`, in a module of its own
that is imported below.
"""

from pyfric.paper.cases import chain_fronts as chain_fronts
from pyfric.paper.cases import event_sizes as event_sizes
from pyfric.paper.cases import heterogeneous_weakening as heterogeneous_weakening
from pyfric.paper.cases import loading_place as loading_place
from pyfric.paper.cases import patch as patch
from pyfric.paper.cases import peak_friction as peak_friction
from pyfric.paper.cases import periodic_strength as periodic_strength
from pyfric.paper.cases import precursor_lengths as precursor_lengths
from pyfric.paper.cases import pressure_and_length as pressure_and_length
from pyfric.paper.cases import random_strength as random_strength
from pyfric.paper.cases import slow_fronts as slow_fronts
from pyfric.paper.cases import strip as strip
from pyfric.paper.cases import surface_grooves as surface_grooves
from pyfric.paper.cases import weak_patch as weak_patch
from pyfric.paper.cases.case import CASES, Case, Found
from pyfric.paper.cases.collection import LIMIT, Result, listed, run, write_page

__all__ = ["CASES", "LIMIT", "Case", "Found", "Result", "listed", "run", "write_page"]
