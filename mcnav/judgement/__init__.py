"""A filter judged by one record: tests of its innovations and errors, and the number of a campaign that is wrong."""
