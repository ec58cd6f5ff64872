"""NASA TN D-1772 recomputed."""
