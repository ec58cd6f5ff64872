"""The seeds' tables recomputed, each number beside the printed one."""
