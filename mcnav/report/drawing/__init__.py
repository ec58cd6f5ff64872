"""Figures as data, and how they are drawn: marks, axes, SVG, matplotlib; nothing here knows a run."""
