"""Hostile run folders by a grammar: finished runs of every sort, changed by somebody who means harm.

Checksums are made anew after a change, so that a folder is consistent but for what has been changed.
"""
