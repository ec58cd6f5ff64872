"""What one record says of a filter: tests of its innovations and errors, and the number of a campaign that is wrong."""
