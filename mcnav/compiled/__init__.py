"""Compiled code: how it is compiled and stored, vectors of lanes, blocks of vectors."""
