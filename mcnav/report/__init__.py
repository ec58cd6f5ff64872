"""A judged run as one self-contained HTML page; nothing is flown or judged here."""
