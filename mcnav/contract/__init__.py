"""Types that rooms exchange: quantities, samples, linear systems, engines, scenarios.

It imports nothing of the other rooms.
"""
