from .design import Design, Grid, LatinHypercube, Seeds, Sobol
from .experiment import run
from .report import report
from .results import Results

__all__ = ["Design", "Grid", "LatinHypercube", "Results", "Seeds", "Sobol", "report", "run"]
