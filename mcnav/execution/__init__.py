"""How a command runs as a process: signals, streams, child processes, its supervisor, threads, its progress."""
