"""The report's figures: each says what it shows, and is drawn as SVG on a page or as axes in a notebook."""
