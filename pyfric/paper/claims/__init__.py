"""Claims of the paper: measured value, band and verdict of each.

    for claim in pyfric.claims.measure():
        print(claim.number, claim.verdict, claim.value, claim.text)

Claims 1 to 16 are statements of the paper. Claims E1 to E10 have exact answers. A claim with
several statements has several parts (1a, 1b ...). Each `Claim` says how its value was measured and
where its band comes from: the paper's words, a convergence study, or the resolution of the compared
values. A value outside its band is a miss.

Claims use the runs behind the paper's figures (`pyfric.paper.runs`) and variations of the Fig. 1
scene.

Source: PRL 107, 074301 (2011).
"""

from pyfric.paper.claims.claim import CLAIMS, Claim, report, save, table
from pyfric.paper.claims.exact import shaken as shaken
from pyfric.paper.claims.scorecard import NUMBERS, measure
from pyfric.paper.runs import jobs

__all__ = ["CLAIMS", "NUMBERS", "Claim", "jobs", "measure", "report", "save", "table"]
