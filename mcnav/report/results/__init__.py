"""What a report shows: an analysed run, its summary, and what each system leaves out."""
