"""The report's figures: drawn as SVG on a page or as axes in a notebook."""
