"""Publications recomputed. Nothing but the commands imports it."""
