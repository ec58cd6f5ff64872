"""Closed loops of the user's own: truth, sensors, navigator, filter, guidance, corrections and triggers.

The loop is one list of maps X -> X+ of X = [truth | parameters | Gauss-Markov processes | estimate | command |
corrections] (`mcnav.systems.closed_loop.maps`). Simulation calls the maps; the linear system is their difference along
the nominal (`mcnav.systems.closed_loop.nominal_flight`), which the linear engine propagates
(`mcnav.systems.closed_loop.timeline`); a sample's linear outcome is that system with the same draws.
"""
