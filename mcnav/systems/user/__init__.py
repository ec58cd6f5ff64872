"""Systems of the user: a class with sources, outputs and a function of errors."""
