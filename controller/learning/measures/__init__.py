"""What a network is judged by: accuracy, matching, disturbance, intervals, the self-test."""
