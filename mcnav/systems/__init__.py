"""Systems with named error sources and named outputs, one folder each, and what they share."""
