"""Motion in, joint targets out: this package knows no robot library and no serial port."""
