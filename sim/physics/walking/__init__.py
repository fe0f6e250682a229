"""Walking: footfalls, plan of the capture point, capture steps, whole body."""
