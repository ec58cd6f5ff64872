"""monaco around scipy: its cases, variables and statistics, with the flights of `tests.benchmarks.peers.scipy_joblib`.

The draws are given to it as values of input variables, in place of drawing its own; the final errors are output
variables. On several cores it uses processes of its own. Flights being those of that peer, two tolerances will do.
"""

from __future__ import annotations

import monaco
import numpy as np
from monaco.mc_enums import SimFunctions

from tests.benchmarks.case import Case, outcomes
from tests.benchmarks.peer import Fly, Peer
from tests.benchmarks.peers.scipy_joblib import fly_one

SOURCES, OUTPUTS = 10, 4


class Flight:
    """The three functions that monaco asks for."""

    def __init__(self, case: Case, tolerance: float) -> None:
        self.case, self.tolerance = case, tolerance

    def preprocess(self, case: monaco.Case) -> tuple[np.ndarray]:
        """Input variables to a draw, shape (10,)."""
        return (np.array([case.invals[f"source {source}"].val for source in range(SOURCES)]),)

    def run(self, draw: np.ndarray) -> tuple[np.ndarray]:
        """A draw to final errors, shape (4,)."""
        starts, errors = self.case.started(draw[None, :])
        last = fly_one(self.case, self.tolerance, starts[:, 0], np.ascontiguousarray(errors[:, 0]))
        return (outcomes(last[:4], last[4:]),)

    def postprocess(self, case: monaco.Case, final: np.ndarray) -> None:
        """Final errors to output variables."""
        for output in range(OUTPUTS):
            case.addOutVal(f"output {output}", float(final[output]))


def prepare(case: Case, tolerance: float, cores: int) -> Fly:
    """A simulation of as many cases as there are draws."""
    flight = Flight(case, tolerance)
    functions = {
        SimFunctions.PREPROCESS: flight.preprocess,
        SimFunctions.RUN: flight.run,
        SimFunctions.POSTPROCESS: flight.postprocess,
    }

    def fly(draws: np.ndarray) -> np.ndarray:
        simulation = monaco.Sim(
            "benchmark",
            len(draws),
            functions,
            seed=0,
            singlethreaded=cores == 1,
            ncores=cores,
            verbose=False,
            debug=True,
        )
        for source in range(SOURCES):
            simulation.addInVar(f"source {source}", vals=draws[:, source].tolist())
        simulation.runSim()
        return np.array([simulation.outvars[f"output {output}"].nums for output in range(OUTPUTS)]).T

    return fly


PEER = Peer(prepare, "relative tolerance", (1e-7, 1e-8), 1 << 20, "own")
