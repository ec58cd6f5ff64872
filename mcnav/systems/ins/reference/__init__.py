"""The reference engine: mechanization from measured increments, its filter, the sensors as it has them."""
