"""Files that are written whole: JSON and text, typed records, tables in parquet."""
