"""Process of a command: signals, streams, child processes, its supervisor, threads, its progress."""
