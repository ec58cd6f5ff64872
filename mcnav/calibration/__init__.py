"""How often the program's own statements are right, measured on systems whose truth is known in closed form."""
