"""What passes between processes: typed messages, the command socket, telemetry, recordings of runs."""
