"""Tables of results: each column is defined once for pages, terminals, data frames and files."""
