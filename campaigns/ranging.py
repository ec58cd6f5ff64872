"""A constant that is measured through a drift, of which no more than bounds are known."""

from mcnav import ClosedLoop, Filter, GaussMarkov, Measurement


class Ranging(ClosedLoop):
    """A constant, measured once a second with a Gauss-Markov drift and white noise; the filter estimates both."""

    truth = {"constant": "m"}
    estimate = {"constant": "m", "drift": "m"}
    processes = {"drift": GaussMarkov("m")}
    measurements = (
        Measurement(
            "range", "m", interval=1.0,
            truth=lambda truth, noise: truth.constant + noise.drift,
            model=lambda estimate: estimate.constant + estimate.drift,
        ),
    )  # fmt: skip
    filter = Filter()
    cycle, end = 1.0, 600.0

    def rates(self, truth):
        """Return the derivative of the constant; the drift is a process."""
        return {"constant": 0.0 * truth.constant}
