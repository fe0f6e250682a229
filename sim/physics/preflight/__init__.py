"""What would happen to a robot that plays a motion or a switch, and the tempo at which it goes well."""
