"""What passes between processes: messages, the command socket, telemetry, recordings of runs."""
