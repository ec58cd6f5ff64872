"""JSON schema of campaign files, for editors and validators.

It is built from what reads the files: the pydantic models of the tables, whose annotations (`mcnav.entries`) mark
quantities, sizes by axis and tables of several forms, and the keys, units and names by which ``[[aiding]]`` and
``[errors]`` are read. Where a ``type`` decides about the other keys, all keys of all types stand in ``properties``, in
which editors look for completions and descriptions, and ``if`` and ``then`` restrict them to those of one type, so that
validators name the key that is wrong.
"""
