"""What is said of results: conditions, sentences, consequences, next steps."""
