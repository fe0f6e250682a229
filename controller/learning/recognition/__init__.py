"""Recognition: which motion is this? Echo-state experts, what they look at, and how streams are cut with them."""
