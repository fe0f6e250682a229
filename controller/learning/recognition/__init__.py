"""Recognition of motions by echo-state experts: features, training, online use, and segmentation of streams."""
